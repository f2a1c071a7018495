#include "core/model/model_file.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/model/model_check.h"
#include "core/model/sealed_file.h"
#include "core/recognition/recognizer.h"
#include "tests/support/full_disk.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class ModelFile : public ::testing::Test {
 protected:
  ModelFile() : file_(folder_.path() / "lab.model") { save_model(*testing::learned_world().model, file_); }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  void write(const std::vector<unsigned char>& bytes) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  [[nodiscard]] std::string refusal() const {
    try {
      (void)load_model(file_);
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  test::TemporaryFolder folder_;
  std::filesystem::path file_;
};

TEST_F(ModelFile, GivesBackEverythingBitForBit) {
  const Model& before = *testing::learned_world().model;
  const Model after = load_model(file());
  EXPECT_EQ(after.normalization, before.normalization);
  EXPECT_EQ(after.eigenspace.mean, before.eigenspace.mean);
  EXPECT_EQ(after.eigenspace.basis, before.eigenspace.basis);
  EXPECT_EQ(after.eigenspace.eigenvalues, before.eigenspace.eigenvalues);
  EXPECT_EQ(after.eigenspace.total_scatter, before.eigenspace.total_scatter);
  EXPECT_EQ(after.provenance.created, before.provenance.created);
  EXPECT_EQ(after.provenance.solver, before.provenance.solver);
  EXPECT_EQ(after.decision.weights, before.decision.weights);
  EXPECT_EQ(after.decision.required, before.decision.required);
  EXPECT_EQ(after.decision.required_occluded, before.decision.required_occluded);
  EXPECT_EQ(after.decision.settled, before.decision.settled);
  EXPECT_EQ(after.decision.held_for_acceptance, before.decision.held_for_acceptance);
  EXPECT_EQ(after.decision.set, before.decision.set);
  EXPECT_EQ(after.decision.expected, before.decision.expected);
  EXPECT_EQ(after.decision.known, before.decision.known);
  EXPECT_EQ(after.decision.unknown, before.decision.unknown);
  EXPECT_EQ(after.decision.tuning, before.decision.tuning);
  ASSERT_EQ(after.objects.size(), before.objects.size());
  for (std::size_t i = 0; i < after.objects.size(); ++i) {
    const ModelObject& a = after.objects[i];
    const ModelObject& b = before.objects[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.workspace, b.workspace);
    EXPECT_EQ(a.manifold.coefficients(), b.manifold.coefficients());
    EXPECT_EQ(a.manifold.degree(), b.manifold.degree());
    EXPECT_EQ(a.typical_distance, b.typical_distance);
    EXPECT_EQ(a.dof_observable, b.dof_observable);
    EXPECT_EQ(a.pose_observable, b.pose_observable);
    EXPECT_EQ(a.views, b.views);
    ASSERT_TRUE(a.space.has_value());
    EXPECT_EQ(a.space->eigenspace.basis, b.space->eigenspace.basis);
    EXPECT_EQ(a.space->manifold.coefficients(), b.space->manifold.coefficients());
    EXPECT_EQ(a.space->better_pose, b.space->better_pose);
  }
}

TEST_F(ModelFile, ALoadedModelRecognisesLikeTheLearnedOne) {
  Recognizer learned(testing::learned_world().model);
  Recognizer loaded(std::make_shared<const Model>(load_model(file())));
  const cv::Mat scene = testing::scene_with(2, 100.0);
  const auto a = learned.recognize(scene);
  const auto b = loaded.recognize(scene);
  ASSERT_EQ(a.size(), 1U);
  ASSERT_EQ(b.size(), 1U);
  EXPECT_EQ(a[0].best->object, b[0].best->object);
  EXPECT_EQ(a[0].best->q, b[0].best->q);
  EXPECT_EQ(a[0].best->distance, b[0].best->distance);
}

TEST_F(ModelFile, RefusesOneFlippedByteAnywhere) {
  const auto bytes = read_file(file());
  ASSERT_GT(bytes.size(), 10000U);
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at < 512; at += 3) places.push_back(at);                     // our header
  for (std::size_t at = 512; at < 4096; at += 61) places.push_back(at);                 // HDF5's own
  for (std::size_t i = 1; i <= 150; ++i) places.push_back(bytes.size() * i / 150 - 1);  // everywhere
  for (const std::size_t at : places) {
    auto damaged = bytes;
    damaged[at] ^= static_cast<unsigned char>(1U << (at % 8));
    write(damaged);
    EXPECT_THAT(refusal(), AnyOf(HasSubstr("damaged"), HasSubstr("not an eigenpose model"),
                                 HasSubstr("version"), HasSubstr("truncated")))
        << "byte " << at;
  }
  write(bytes);
  EXPECT_EQ(refusal(), "accepted");
}

TEST_F(ModelFile, RefusesAFileCutOffOrContinuedAnywhere) {
  auto bytes = read_file(file());
  for (std::size_t i = 0; i < 40; ++i) {
    write({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() * i / 40)});
    EXPECT_NE(refusal(), "accepted") << i;
  }
  write({bytes.begin(), bytes.end() - 1});
  EXPECT_THAT(refusal(), HasSubstr("truncated"));
  bytes.push_back(0);
  write(bytes);
  EXPECT_THAT(refusal(), HasSubstr("damaged"));
}

TEST_F(ModelFile, IsTruncatedWhereverItsSealIsCut) {
  const auto bytes = read_file(file());
  const std::string start(bytes.begin(), bytes.begin() + 64);
  const std::size_t version_end = start.find("version 5") + 9;
  for (std::size_t size = version_end; size < seal_size; ++size) {
    write({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)});
    EXPECT_THAT(refusal(), HasSubstr("truncated")) << size;
  }
}

TEST_F(ModelFile, KeepsWhereItCameFrom) {
  Model model = *testing::learned_world().model;
  for (const double bound : {0.0, 0.02}) {
    model.provenance = {"1.2.3", "2026-01-02T03:04:05Z", "/sets/lab", "krylov", 0.93, bound};
    save_model(model, file());
    const Provenance read = load_model(file()).provenance;
    EXPECT_EQ(read.program_version, "1.2.3");
    EXPECT_EQ(read.created, "2026-01-02T03:04:05Z");
    EXPECT_EQ(read.image_sets, "/sets/lab");
    EXPECT_EQ(read.solver, "krylov");
    EXPECT_EQ(read.energy, 0.93);
    EXPECT_EQ(read.energy_bound, bound);
  }
}

TEST_F(ModelFile, SaysWhatToDoAboutAnotherVersion) {
  auto bytes = read_file(file());
  const std::string text(bytes.begin(), bytes.begin() + 100);
  const auto at = text.find("version 5");
  ASSERT_NE(at, std::string::npos);
  for (const char version : {'1', '2', '3', '4', '9'}) {
    bytes[at + 8] = static_cast<unsigned char>(version);
    write(bytes);
    EXPECT_THAT(refusal(), HasSubstr(std::string("is of version ") + version +
                                     ", this program reads version 5; learn it again"));
  }
}

TEST_F(ModelFile, RefusesWhatIsNoModel) {
  write({'h', 'e', 'l', 'l', 'o'});
  EXPECT_THAT(refusal(), HasSubstr("not an eigenpose model"));
  std::filesystem::remove(file());
  EXPECT_THAT(refusal(), HasSubstr("no such model"));
}

TEST_F(ModelFile, OpensNothingButPlainFiles) {
  std::filesystem::remove(file());
  ASSERT_EQ(::mkfifo(file().c_str(), 0600), 0);
  EXPECT_THAT(refusal(), HasSubstr("is a pipe")) << "and nobody writes into it";
}

/// The only place in `bytes` where `value` stands.
std::size_t place_of(const std::vector<unsigned char>& bytes, double value) {
  std::array<unsigned char, sizeof value> text{};
  std::memcpy(text.data(), &value, sizeof value);
  const auto at = std::search(bytes.begin(), bytes.end(), text.begin(), text.end());
  if (at == bytes.end() || std::search(at + 1, bytes.end(), text.begin(), text.end()) != bytes.end())
    return 0;
  return static_cast<std::size_t>(at - bytes.begin());
}

TEST_F(ModelFile, RefusesValuesThatCannotBeThoughTheSealIsGood) {
  auto bytes = read_file(file());
  const std::size_t at = place_of(bytes, testing::learned_world().model->objects[1].typical_distance);
  ASSERT_NE(at, 0U);
  const auto refusal_of = [&](double value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
    AtomicFile sealed(file());
    sealed.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    seal_file({"eigenpose model\n", 5, "", ""}, sealed);
    sealed.commit();
    return refusal();
  };
  EXPECT_EQ(refusal_of(0.25), "accepted") << "the seal is good";
  for (const double value : {std::nan(""), std::numeric_limits<double>::infinity(), -1.0})
    EXPECT_THAT(refusal_of(value), AllOf(HasSubstr("lab.model: object \"round\": the typical distance is "),
                                         HasSubstr("learn it again from its image sets")));
}

/// A way to spoil a model, and what is said of it.
struct Spoiled {
  std::string said;
  std::function<void(Model&)> spoil;
};

TEST(ModelCheck, NamesWhatIsWrong) {
  const double nan = std::nan("");
  const std::vector<Spoiled> all = {
      {"the mean: not every number is finite",
       [&](Model& m) { m.eigenspace.mean(3) = static_cast<float>(nan); }},
      {"the basis: not every number is finite",
       [&](Model& m) { m.eigenspace.basis(3, 1) = std::numeric_limits<float>::infinity(); }},
      {"the eigenvalues: not every number is finite", [&](Model& m) { m.eigenspace.eigenvalues(0) = nan; }},
      {"the total scatter is -1", [&](Model& m) { m.eigenspace.total_scatter = -1.0; }},
      {"do not fit together", [&](Model& m) { m.eigenspace.mean.conservativeResize(10); }},
      {"the size of normalised views is 7", [&](Model& m) { m.normalization.size = 7; }},
      {"the share of dirt is nan", [&](Model& m) { m.normalization.segmentation.dirt_share = nan; }},
      {"sigmas) is -1", [&](Model& m) { m.normalization.segmentation.noise_sigmas = -1; }},
      {"it has no object", [&](Model& m) { m.objects.clear(); }},
      {"two objects are named \"one\"", [&](Model& m) { m.objects[1].name = m.objects[0].name; }},
      {"\"a\\nlevel=error\" cannot be an object's name",
       [&](Model& m) { m.objects[1].name = "a\nlevel=error"; }},
      {"\"\\x1b[2J\" cannot", [&](Model& m) { m.objects[1].name = "\x1b[2J"; }},
      {"the typical distance is nan", [&](Model& m) { m.objects[0].typical_distance = nan; }},
      {"the typical distance is -0.1", [&](Model& m) { m.objects[0].typical_distance = -0.1; }},
      {"the weights of the whole region are not finite",
       [&](Model& m) { m.decision.weights.whole[1] = nan; }},
      {"the weights of windows are not finite", [&](Model& m) { m.decision.weights.windows[7] = nan; }},
      {"the weights of occluded regions are not finite",
       [&](Model& m) { m.decision.weights.occluded[0] = nan; }},
      {"the required evidence is nan", [&](Model& m) { m.decision.required = nan; }},
      {"the required evidence of occluded regions is nan",
       [&](Model& m) { m.decision.required_occluded = nan; }},
      {"the evidence that settles is", [&](Model& m) { m.decision.settled = m.decision.required - 1.0; }},
      {"the set rate of false rejections is 2", [&](Model& m) { m.decision.set.false_rejection = 2.0; }},
      {"the expected rate of false acceptances is -1",
       [&](Model& m) { m.decision.expected.false_acceptance = -1.0; }},
      {"the evidence of learned views is not in order",
       [&](Model& m) {
         m.decision.known = {2.0, 1.0};
       }},
      {"the evidence of learned views are not finite", [&](Model& m) { m.decision.unknown = {nan}; }},
      {"the constant pose_lead is not finite", [&](Model& m) { m.decision.tuning.pose_lead = nan; }},
      {"the effective dimensions is 0", [&](Model& m) { m.decision.tuning.effective_dimensions = 0.0; }},
      {"degrees of freedom do not fit", [&](Model& m) { m.objects[0].dof_observable.clear(); }},
      {"the manifold: not every number is finite",
       [&](Model& m) {
         const Manifold& old = m.objects[2].manifold;
         Eigen::MatrixXd coefficients = old.coefficients();
         coefficients(1, 1) = nan;
         m.objects[2].manifold =
             Manifold::from_coefficients({old.axes().begin(), old.axes().end()}, coefficients, old.degree());
       }},
      {"the manifold does not fit its eigenspace",
       [&](Model& m) {
         const Manifold& old = m.objects[2].manifold;
         m.objects[2].manifold = Manifold::from_coefficients({old.axes().begin(), old.axes().end()},
                                                             old.coefficients().topRows(3), old.degree());
       }},
      {"the basis: not every number is finite",
       [&](Model& m) { m.objects[0].space->eigenspace.basis(0, 0) = static_cast<float>(nan); }},
  };
  ASSERT_NO_THROW(check_model(*testing::learned_world().model));
  for (const Spoiled& spoiled : all) {
    Model model = *testing::learned_world().model;
    spoiled.spoil(model);
    EXPECT_THAT([&] { check_model(model); }, ThrowsMessage<std::invalid_argument>(HasSubstr(spoiled.said)));
  }
}

TEST_F(ModelFile, AModelThatCannotBeReadBackReplacesNone) {
  Model model = *testing::learned_world().model;
  model.objects[0].typical_distance = std::nan("");
  EXPECT_THAT([&] { save_model(model, file()); },
              ThrowsMessage<FileError>(AllOf(HasSubstr("lab.model: read back after writing, it "),
                                             HasSubstr("typical distance is nan"),
                                             HasSubstr("former file is unchanged"))));
  EXPECT_EQ(refusal(), "accepted");
}

TEST_F(ModelFile, AFullDiskIsAnErrorWhereverItFillsAndKeepsTheFormerModel) {
  const auto size = static_cast<rlim_t>(std::filesystem::file_size(file()));
  const auto former = read_file(file());
  std::vector<rlim_t> limits{0, 1, 511, 512, 600, 1000, 2048, 4096, size - 4096, size - 512, size - 1};
  for (rlim_t i = 1; i < 20; ++i) limits.push_back(size * i / 20);
  for (const rlim_t limit : limits) {
    const test::FullDisk disk(limit);
    EXPECT_THAT([&] { save_model(*testing::learned_world().model, file()); },
                ThrowsMessage<FileError>(HasSubstr("former file is unchanged")))
        << limit;
  }
  EXPECT_EQ(read_file(file()), former);
  {
    const test::FullDisk disk(size);
    EXPECT_NO_THROW(save_model(*testing::learned_world().model, file())) << "it just fits";
  }
  EXPECT_EQ(read_file(file()), former) << "the same model is the same bytes";
}

TEST_F(ModelFile, SavingReplacesTheFormerFileOrLeavesIt) {
  save_model(*testing::learned_world().model, file());
  EXPECT_EQ(refusal(), "accepted");
  EXPECT_THROW(save_model(*testing::learned_world().model, file().parent_path() / "absent/lab.model"),
               FileError);
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(file().parent_path()))
    ++files;
  EXPECT_EQ(files, 1U) << "no part of a file is left behind";
}

}  // namespace
}  // namespace eigenpose
