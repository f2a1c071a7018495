#include "core/learning/learned_grid.h"

#include <gmock/gmock.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Workspace table_and_light() {
  return Workspace({{"table", "deg", 0.0, 360.0, true}, {"light", "deg", -60.0, 60.0, false}});
}

TEST(LearnedGrid, SortsViewsWithTheLastDofRunningFastest) {
  std::vector<std::vector<double>> poses;
  for (const double light : {30.0, -30.0, 0.0})
    for (const double table : {240.0, 0.0, 120.0, 60.0, 300.0, 180.0}) poses.push_back({table, light});
  const LearnedGrid grid = find_learned_grid(table_and_light(), poses, "mug");
  EXPECT_THAT(grid.axes[0].samples, ElementsAre(0, 60, 120, 180, 240, 300));
  EXPECT_THAT(grid.axes[1].samples, ElementsAre(-30, 0, 30));
  ASSERT_EQ(grid.order.size(), 18U);
  EXPECT_EQ(poses[grid.order[0]], (std::vector<double>{0.0, -30.0}));
  EXPECT_EQ(poses[grid.order[1]], (std::vector<double>{0.0, 0.0}));
  EXPECT_EQ(poses[grid.order[17]], (std::vector<double>{300.0, 30.0}));
}

TEST(LearnedGrid, ForgivesThePlayOfTheDriveAlsoAtTheSeam) {
  std::vector<std::vector<double>> poses;
  for (const double light : {-30.02, 29.98})
    for (int i = 0; i < 8; ++i) poses.push_back({i * 45.0 + (light > 0 ? 0.03 : -0.03), light});
  const LearnedGrid grid = find_learned_grid(table_and_light(), poses, "mug");
  ASSERT_EQ(grid.axes[0].samples.size(), 8U);
  EXPECT_THAT(grid.axes[0].samples[0], DoubleNear(0.0, 1e-9)) << "359.97 and 0.03 are one value";
  EXPECT_THAT(grid.axes[0].samples[3], DoubleNear(135.0, 1e-9));
}

TEST(LearnedGrid, KeepsEveryPoseOfASingleDof) {
  std::vector<std::vector<double>> poses;
  for (int i = 0; i < 720; ++i) poses.push_back({i * 0.5});
  EXPECT_EQ(find_learned_grid(turntable_workspace(), poses, "mug").axes[0].samples.size(), 720U);
}

TEST(LearnedGrid, NamesTheGapAndTheDouble) {
  std::vector<std::vector<double>> poses;
  for (const double light : {-30.0, 30.0})
    for (int i = 0; i < 4; ++i) poses.push_back({i * 90.0, light});
  auto gap = poses;
  gap.erase(gap.begin() + 6);
  EXPECT_THAT([&] { find_learned_grid(table_and_light(), gap, "mug"); },
              ThrowsMessage<Error>(HasSubstr("there is none at table 180 deg, light 30 deg")));
  auto twice = poses;
  twice[6] = twice[5];
  EXPECT_THAT([&] { find_learned_grid(table_and_light(), twice, "mug"); },
              ThrowsMessage<Error>(HasSubstr("two views at table 90 deg, light 30 deg")));
}

TEST(LearnedGrid, ATurnNeedsThreeViews) {
  const std::vector<std::vector<double>> poses{{0.0}, {180.0}};
  EXPECT_THAT([&] { find_learned_grid(turntable_workspace(), poses, "mug"); },
              ThrowsMessage<Error>(HasSubstr("only 2 values of table")));
}

}  // namespace
}  // namespace eigenpose
