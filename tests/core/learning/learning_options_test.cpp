#include <exception>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>

#include "core/learning/learning.h"
#include "core/learning/training_archive.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(LearningOptions, LeavesPicturesHalfOfTheMemoryLimit) {
  const test::TemporaryFolder folder;
  // Where they need more they go to the scratch folder: one that is not there says so.
  testing::write_turn(folder.path(), "one", 1, 24);
  const auto sets = open_image_sets(folder.path());
  LearningOptions options = testing::small_learning();
  options.scratch_folder = folder.path() / "absent";
  const std::size_t pictures = 24 * picture_length(options.normalization);
  const auto outcome = [&](std::size_t limit) {
    options.memory_limit = limit;
    try {
      (void)learn(all_views(sets), options);
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string("learned");
  };
  EXPECT_THAT(outcome(2 * pictures - 2), HasSubstr("absent"));
  EXPECT_THAT(outcome(2 * pictures), Not(HasSubstr("absent"))) << "though the solver may need more";
}

TEST(LearningOptions, KeepsItsViewsItselfWhereNobodyAsksForAReport) {
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "one", 1, 12);
  const auto sets = open_image_sets(folder.path());
  LearningOptions options = testing::small_learning();
  options.kept_views = folder.path() / "kept.views";
  LearningReport report;
  (void)learn(all_views(sets), options, &report);
  ASSERT_TRUE(report.kept_views);
  EXPECT_FALSE(std::filesystem::exists(options.kept_views)) << "whoever has the report commits them";
  (void)learn(all_views(sets), options);
  EXPECT_TRUE(std::filesystem::exists(options.kept_views));
}

}  // namespace
}  // namespace eigenpose
