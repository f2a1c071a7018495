// Which objects and poses look alike.
#include "core/evaluation/resemblance.h"

#include <cmath>
#include <numbers>

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

/// Circles of radius 1 at the given heights; each object's views are rejected beyond its typical distance.
Model circles(const std::vector<double>& heights, const std::vector<double>& rejected_beyond) {
  Model model;
  const SampleAxis turn{turntable_workspace()[0], {0, 45, 90, 135, 180, 225, 270, 315}};
  for (std::size_t o = 0; o < heights.size(); ++o) {
    Eigen::MatrixXd points(3, 8);
    for (int i = 0; i < 8; ++i)
      points.col(i) << std::cos(0.25 * std::numbers::pi * i), std::sin(0.25 * std::numbers::pi * i),
          heights[o];
    model.objects.push_back(
        {"object" + std::to_string(o), turntable_workspace(), Manifold::interpolate({turn}, points)});
    model.objects.back().typical_distance = rejected_beyond[o];
  }
  model.decision.weights.whole = {0.0, -1.0, 1.0};
  model.decision.required = 0.0;
  return model;
}

TEST(Resemblance, IsOfTheObjectWhoseViewsPassForTheOtherByTheDistanceOfTheOther) {
  // 0.1 apart: views of the first are accepted as the second, not the other way round.
  for (const bool first : {true, false}) {
    const Model model = circles({0.0, 0.1}, first ? std::vector{0.05, 0.2} : std::vector{0.2, 0.05});
    const auto pairs = alike_objects(model);
    ASSERT_EQ(pairs.size(), 1U);
    EXPECT_EQ(pairs[0].first, first ? 0U : 1U);
    EXPECT_EQ(pairs[0].second, first ? 1U : 0U);
    EXPECT_NEAR(pairs[0].distance, 0.1, 1e-6);
    EXPECT_NEAR(pairs[0].share, 1.0, 1e-9);
  }
  EXPECT_TRUE(alike_objects(circles({0.0, 0.1}, {0.05, 0.05})).empty());
}

TEST(Resemblance, PutsTheMostAlikeFirst) {
  const auto pairs = alike_objects(circles({0.0, 0.3, 0.5}, {0.4, 0.4, 0.4}));
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_NEAR(pairs[0].distance, 0.2, 1e-6);
  EXPECT_NEAR(pairs[1].distance, 0.3, 1e-6);
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
