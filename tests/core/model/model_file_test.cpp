#include "core/model/model_file.h"

#include <fstream>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "core/recognition/recognizer.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

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
  ASSERT_EQ(after.objects.size(), before.objects.size());
  for (std::size_t i = 0; i < after.objects.size(); ++i) {
    const ModelObject& a = after.objects[i];
    const ModelObject& b = before.objects[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.workspace, b.workspace);
    EXPECT_EQ(a.manifold.coefficients(), b.manifold.coefficients());
    EXPECT_EQ(a.manifold.degree(), b.manifold.degree());
    EXPECT_EQ(a.rejection_distance, b.rejection_distance);
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

TEST_F(ModelFile, SaysWhatToDoAboutAnotherVersion) {
  auto bytes = read_file(file());
  const std::string text(bytes.begin(), bytes.begin() + 100);
  const auto at = text.find("version 3");
  ASSERT_NE(at, std::string::npos);
  bytes[at + 8] = '9';
  write(bytes);
  EXPECT_THAT(refusal(), HasSubstr("version 9, this program reads version 3; learn it again"));
}

TEST_F(ModelFile, RefusesWhatIsNoModel) {
  write({'h', 'e', 'l', 'l', 'o'});
  EXPECT_THAT(refusal(), HasSubstr("not an eigenpose model"));
  std::filesystem::remove(file());
  EXPECT_THAT(refusal(), HasSubstr("no such model"));
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
