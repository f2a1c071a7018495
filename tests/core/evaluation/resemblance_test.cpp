// Which objects and poses look alike.
#include "core/evaluation/resemblance.h"

#include <gmock/gmock.h>

#include "core/base/angle.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

TEST(Resemblance, FindsNoPairAmongObjectsThatDiffer) {
  EXPECT_TRUE(alike_objects(*testing::learned_world().model).empty());
}

TEST(Resemblance, FindsTwinsAtTheSamePose) {
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "left", 1, 24);
  testing::SceneKnobs again;
  again.noise_sigma = 1.2;
  testing::write_turn(folder.path(), "right", 1, 24, again);
  testing::write_turn(folder.path(), "other", 2, 24);
  const auto sets = open_image_sets(folder.path());
  const Model model = learn(all_views(sets), testing::small_learning());
  const auto pairs = alike_objects(model);
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_NE(pairs[0].first, pairs[0].second);
  EXPECT_NE(model.objects[pairs[0].first].name, "other");
  EXPECT_NE(model.objects[pairs[0].second].name, "other");
  EXPECT_NEAR(pairs[0].share, 1.0, 1e-9);
  EXPECT_LT(std::abs(model.objects[0].workspace[0].difference(pairs[0].first_q[0], pairs[0].second_q[0])),
            5.0);
  EXPECT_LT(pairs[0].distance, model.rejection_distance(pairs[0].second));
}

TEST(Resemblance, FindsThePosesOfAnObjectThatLooksTheSameFromAllSides) {
  const Model& model = *testing::learned_world().model;
  const auto poses = alike_poses(model);
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_EQ(model.objects[poses[0].first].name, "round");
  EXPECT_EQ(poses[0].first, poses[0].second);
  EXPECT_GT(poses[0].share, 0.9);
}

}  // namespace
}  // namespace eigenpose
