#include "core/learning/training_archive.h"

#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "core/model/model_file.h"
#include "tests/core/learning/training_archive_fixture.h"
#include "tests/support/full_disk.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

TEST_F(TrainingArchiveTest, AnObjectThatJoinsGivesTheModelLearnedAnewByteForByte) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  std::filesystem::remove_all(sets());
  write("fresh", 3);  // stands first in the order of names
  const auto grown = updated("kept", {}, open_image_sets(sets()));
  write("one", 1);
  write("two", 2);
  EXPECT_EQ(grown, learned_anew());
}

TEST_F(TrainingArchiveTest, WithoutAnObjectTheModelIsTheOneLearnedAnewByteForByte) {
  write("one", 1);
  write("two", 2);
  write("three", 3);
  keep("kept");
  std::filesystem::remove_all(sets());
  const auto shrunk = updated("kept", {"two"});
  write("one", 1);
  write("three", 3);
  EXPECT_EQ(shrunk, learned_anew());
}

TEST_F(TrainingArchiveTest, HoldsForImageTypesPartsAndSolversWithoutProducts) {
  LearningOptions gradient = testing::small_learning();
  set_image_type(gradient.normalization, "gradient");
  LearningOptions parts = testing::small_learning();
  parts.parts = true;
  parts.rates = {0.1, 0.25};
  LearningOptions krylov = testing::small_learning();
  krylov.solver.solver = "krylov";
  krylov.solver.components = 3;
  krylov.solver.energy = 0.9;
  for (const LearningOptions& options : {gradient, parts, krylov}) {
    std::filesystem::remove_all(sets());
    write("one", 1);
    write("two", 2);
    keep("kept", options);
    EXPECT_EQ(TrainingArchive(path("kept")).products().size() > 0, options.solver.solver != "krylov");
    const LearningOptions kept = TrainingArchive(path("kept")).options();
    EXPECT_EQ(kept.rates, options.rates);
    std::filesystem::remove_all(sets());
    write("three", 3);
    const auto changed = updated("kept", {"one"}, open_image_sets(sets()));
    write("two", 2);
    EXPECT_EQ(changed, learned_anew(options)) << options.normalization.type << options.solver.solver;
  }
}

TEST_F(TrainingArchiveTest, TheUpdateKeepsItsViewsInTurn) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  std::filesystem::remove_all(sets());
  write("three", 3);
  LearningOptions options = TrainingArchive(path("kept")).options();
  options.kept_views = path("kept");
  (void)updated("kept", {"one"}, open_image_sets(sets()), options);
  std::filesystem::remove_all(sets());
  const auto last = updated("kept", {"two"});
  write("three", 3);
  EXPECT_EQ(last, learned_anew());
}

TEST_F(TrainingArchiveTest, ReadyCutViewsComeAndGoAmongOthers) {
  write("one", 1);
  ImageSetWriter writer(sets(), "cut", turntable_workspace(), nlohmann::json::object(),
                        {.cropped = true, .sync_every_view = false});
  for (int i = 0; i < 12; ++i) {
    const cv::Mat scene = testing::scene_with(2, 30.0 * i);
    writer.add(scene(cv::Rect(40, 20, 80, 80)), {30.0 * i});
  }
  writer.finish();
  LearningOptions options = testing::small_learning();
  options.parts = true;  // asks how large the regions were
  keep("both", options);
  const auto all = learned_anew(options);
  std::filesystem::rename(sets() / "one", path("one"));
  EXPECT_EQ(updated("both", {"one"}), learned_anew(options)) << "ready-cut ones are left";
  keep("cut", options);
  EXPECT_EQ(updated("cut", {}, open_image_sets(path("one"))), all) << "the others are joined";
}

TEST_F(TrainingArchiveTest, ViewsBeyondTheMemoryLimitComeAndGoToo) {
  testing::write_turn(sets(), "one", 1, 36);
  write("two", 2);
  LearningOptions options = testing::small_learning();
  // In colour, known products leave the solver less memory: its tiles are others, and round otherwise.
  options.normalization.color = false;
  options.solver.solver = "gram";
  options.solver.components = 2;
  keep("kept", options);
  std::filesystem::remove_all(sets() / "two");
  options.memory_limit = 70 * picture_length(options.normalization);  // pictures may take half: 35 of 36
  options.scratch_folder = path("");
  EXPECT_EQ(updated("kept", {"two"}, {}, options), learned_anew(options));
}

TEST_F(TrainingArchiveTest, RefusesNamesThatAreNotThereOrTaken) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  const TrainingArchive kept(path("kept"));
  const auto message = [&](const std::vector<std::string>& leaving, const std::vector<ImageSet>& joining) {
    try {
      (void)updated_sets(kept, leaving, joining);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(message({"mug"}, {}), AllOf(HasSubstr("\"mug\""), HasSubstr("one, two")));
  EXPECT_THAT(message({"one"}, open_image_sets(sets())), AllOf(HasSubstr("\"two\""), HasSubstr("already")));
  EXPECT_EQ(message({"one"}, {ImageSet::open(sets() / "one")}), "accepted");
}

TEST_F(TrainingArchiveTest, RefusesAnotherNormalisation) {
  write("one", 1);
  keep("kept");
  const TrainingArchive kept(path("kept"));
  LearningOptions options = kept.options();
  options.normalization.size = 24;
  EXPECT_THROW((void)learn(updated_sets(kept, {}, {}), options), Error);
  options = kept.options();
  options.normalization.segmentation.noise_sigmas += 1.0;
  EXPECT_THROW((void)learn(updated_sets(kept, {}, {}), options), Error);
}

TEST_F(TrainingArchiveTest, RefusesOneFlippedByteAnywhereAndAFileCutOff) {
  write("one", 1);
  keep("kept");
  EXPECT_EQ(refusal("kept"), "accepted");
  const auto bytes = read_file(path("kept"));
  const auto put = [&](const std::vector<unsigned char>& changed) {
    std::ofstream(path("kept"), std::ios::binary | std::ios::trunc)
        .write(reinterpret_cast<const char*>(changed.data()), static_cast<std::streamsize>(changed.size()));
  };
  for (std::size_t i = 0; i < 200; ++i) {
    const std::size_t at = i < 100 ? 6 * i : bytes.size() * (i - 99) / 101;
    auto damaged = bytes;
    damaged[at] ^= static_cast<unsigned char>(1U << (at % 8));
    put(damaged);
    EXPECT_THAT(refusal("kept"), AnyOf(HasSubstr("damaged"), HasSubstr("no file of kept views"),
                                       HasSubstr("version"), HasSubstr("truncated")))
        << "byte " << at;
  }
  for (std::size_t i = 0; i < 20; ++i) {
    put({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() * i / 20)});
    EXPECT_NE(refusal("kept"), "accepted") << i;
  }
  auto other = bytes;
  const std::string text(other.begin(), other.begin() + 100);
  for (const char version : {'0', '1', '2', '7'}) {
    other[text.find("version 3") + 8] = static_cast<unsigned char>(version);
    put(other);
    EXPECT_THAT(refusal("kept"),
                AllOf(HasSubstr(std::string("version ") + version), HasSubstr("--keep-views")));
  }
  std::filesystem::remove(path("kept"));
  EXPECT_THAT(refusal("kept"), HasSubstr("no kept views"));
}

TEST_F(TrainingArchiveTest, ReplaceTheFormerOnesWhenTheModelIsSavedAndNotBefore) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  write("two", 2);
  LearningOptions options = testing::small_learning();
  options.kept_views = path("kept");
  const auto images = open_image_sets(sets());
  LearningReport report;
  const Model model = learn(all_views(images), options, &report);
  EXPECT_EQ(read_file(path("kept")), before);
  ASSERT_NE(report.kept_views, nullptr);
  report.kept_views->commit();
  EXPECT_TRUE(TrainingArchive(path("kept")).belong_to(model));
  {
    LearningReport dropped;
    (void)learn(all_views(images), options, &dropped);
  }
  EXPECT_TRUE(TrainingArchive(path("kept")).belong_to(model)) << "what is not committed replaces nothing";
}

TEST_F(TrainingArchiveTest, AFullDiskIsAnErrorWhereverItFillsAndKeepsTheFormerOnes) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  for (rlim_t i = 0; i < 10; ++i) {
    const test::FullDisk disk(static_cast<rlim_t>(before.size()) * i / 10);
    EXPECT_THROW(keep("kept"), FileError) << i;
  }
  EXPECT_EQ(read_file(path("kept")), before);
}

TEST_F(TrainingArchiveTest, AreNotTouchedWhereLearningFails) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  write("two", 2);
  LearningOptions options = testing::small_learning();
  options.kept_views = path("kept");
  std::stop_source stop;
  const auto images = open_image_sets(sets());
  const auto stop_late = [&](const ProgressUpdate& update) {
    if (update.stage != "normalising" && update.stage != "inner products") stop.request_stop();
  };
  EXPECT_THROW((void)learn(all_views(images), options, nullptr, stop_late, stop.get_token()), Interrupted);
  EXPECT_EQ(read_file(path("kept")), before);
  for (const auto& entry : std::filesystem::directory_iterator(path("")))
    EXPECT_THAT(entry.path().filename().string(), AnyOf("kept", "sets"));
}

}  // namespace
}  // namespace eigenpose
