#include "core/learning/calibration/yardsticks.h"

#include <gtest/gtest.h>

#include "core/learning/learning.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

TEST(Yardsticks, BoundTheShareOfForeignWindows) {
  // All views of an object that looks the same from all sides have the same windows; a new view has not.
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "one", 1, 4);
  testing::write_turn(folder.path(), "round", testing::symmetric_kind, 4);
  const auto sets = open_image_sets(folder.path());
  LearningOptions options = testing::small_learning();
  options.normalization.size = 64;
  options.parts = true;
  const Model model = learn(all_views(sets), options);
  ASSERT_EQ(model.objects[1].name, "round");
  EXPECT_EQ(model.parts->calibration[1].foreign_share, 0.05);
  EXPECT_GE(model.parts->calibration[0].foreign_share, 0.05);
  EXPECT_LE(model.parts->calibration[0].foreign_share, 0.3);
}

}  // namespace
}  // namespace eigenpose
