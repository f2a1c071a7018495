#include "core/learning/learned_grid.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(LearnedGrid, TakesUnevenValuesOfASingleDofAsTheyAre) {
  const std::vector<std::vector<double>> poses{{10.5}, {0.0}, {359.0}, {91.25}};
  const LearnedGrid grid = find_learned_grid(turntable_workspace(), poses, "mug");
  EXPECT_THAT(grid.axes[0].samples, ElementsAre(0.0, 10.5, 91.25, 359.0));
  EXPECT_THAT(grid.order, ElementsAre(1, 0, 3, 2));
  EXPECT_EQ(grid.poses.size(), 0) << "one DOF always is a grid";
}

TEST(LearnedGrid, KeepsTheAxesOfAGridWithHolesAndGivesThePoses) {
  std::vector<std::vector<double>> poses;
  for (const double light : {-30.0, 30.0})
    for (int i = 0; i < 4; ++i) poses.push_back({i * 90.0, light});
  poses.erase(poses.begin() + 6);
  const LearnedGrid grid = find_learned_grid(table_and_light(), poses, "mug");
  EXPECT_THAT(grid.axes[0].samples, ElementsAre(0, 90, 180, 270));
  EXPECT_THAT(grid.axes[1].samples, ElementsAre(-30, 30));
  ASSERT_EQ(grid.order.size(), 7U);
  ASSERT_EQ(grid.poses.cols(), 7);
  for (std::size_t i = 0; i < 7; ++i)
    for (Eigen::Index d = 0; d < 2; ++d)
      EXPECT_EQ(grid.poses(d, static_cast<Eigen::Index>(i)),
                poses[grid.order[i]][static_cast<std::size_t>(d)]);
}

TEST(LearnedGrid, SpreadsEvenAxesOverPosesThatAreNoGrid) {
  std::vector<std::vector<double>> poses;
  for (int i = 0; i < 60; ++i)
    poses.push_back({std::fmod(i * 137.5, 360.0), -60.0 + std::fmod(i * 31.7, 120.0)});
  const LearnedGrid grid = find_learned_grid(table_and_light(), poses, "mug");
  // Two thirds of 60 coefficients, four times as many around the turn: 12.6 and 3.2.
  ASSERT_EQ(grid.axes[0].samples.size(), 13U);
  ASSERT_EQ(grid.axes[1].samples.size(), 3U);
  EXPECT_DOUBLE_EQ(grid.axes[0].samples[1], 360.0 / 13.0);
  double lowest = 60.0;
  double highest = -60.0;
  for (const auto& pose : poses) {
    lowest = std::min(lowest, pose[1]);
    highest = std::max(highest, pose[1]);
  }
  // Values that differ by less than the play are one, at their mean.
  EXPECT_NEAR(grid.axes[1].samples.front(), lowest, 0.24);
  EXPECT_NEAR(grid.axes[1].samples.back(), highest, 0.24);
  EXPECT_EQ(grid.poses.cols(), 60);
}

TEST(LearnedGrid, NamesViewsAtOnePoseAndKeepsTheFirst) {
  std::vector<std::vector<double>> poses;
  for (const double light : {-30.0, 30.0})
    for (int i = 0; i < 4; ++i) poses.push_back({i * 90.0, light});
  poses.push_back({90.1, 30.0});
  const LearnedGrid grid = find_learned_grid(table_and_light(), poses, "mug");
  EXPECT_EQ(grid.order.size(), 8U);
  EXPECT_EQ(grid.poses.size(), 0);
  ASSERT_EQ(grid.doubled.size(), 1U);
  EXPECT_EQ(grid.doubled[0].view, 8U);
  EXPECT_EQ(grid.doubled[0].same_as, 5U);
}

TEST(LearnedGrid, RefusesPosesThatMakeNoManifold) {
  const auto refusal = [](const Workspace& workspace, const std::vector<std::vector<double>>& poses) {
    try {
      (void)find_learned_grid(workspace, poses, "mug");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal(turntable_workspace(), {{0.0}, {180.0}}), HasSubstr("only 2 values of table"));
  EXPECT_THAT(refusal(turntable_workspace(), {{20.0}, {20.0}, {20.0}}),
              AllOf(HasSubstr("\"mug\""), HasSubstr("1 different pose")));
  std::vector<std::vector<double>> together;
  for (int i = 0; i < 12; ++i) together.push_back({10.0 * i, -60.0 + 10.0 * i});
  const Workspace two({{"x", "mm", 0.0, 120.0, false}, {"y", "mm", -60.0, 60.0, false}});
  EXPECT_THAT(refusal(two, together), AllOf(HasSubstr("\"mug\""), HasSubstr("\"y\""), HasSubstr("follows")));
}

TEST(LearnedGrid, WritesAPoseWithItsUnits) {
  const std::vector<double> pose{90.0, -12.5};
  EXPECT_EQ(pose_text(table_and_light(), pose), "table 90 deg, light -12.5 deg");
}

}  // namespace
}  // namespace eigenpose
