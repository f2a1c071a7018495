#include "core/learning/calibration/thinned_manifolds.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/manifold/sample_grid.h"

namespace eigenpose {
namespace {

/// Views at 0, 1, … of one DOF on the points of a line.
struct LineOfViews {
  LineOfViews(std::size_t views, bool periodic) {
    const Dof dof{"x", "mm", 0.0, static_cast<double>(views), periodic};
    SampleAxis axis{dof, {}};
    points.resize(2, static_cast<Eigen::Index>(views));
    for (std::size_t i = 0; i < views; ++i) {
      axis.samples.push_back(static_cast<double>(i));
      points.col(static_cast<Eigen::Index>(i)) << static_cast<double>(i), 0.0;
    }
    object.workspace = Workspace({dof});
    object.axes = {axis};
    object.count = views;
  }
  [[nodiscard]] Eigen::VectorXf point(std::size_t view) const {
    return points.col(static_cast<Eigen::Index>(view)).cast<float>();
  }
  ObjectViews object;
  Eigen::MatrixXd points;
};

TEST(ThinnedManifolds, KeepBothEndsOfAnOpenDof) {
  const LineOfViews line(9, false);
  ThinnedManifolds thinned(line.object, line.points, 2);
  for (std::size_t from = 1; from < 8; ++from)
    for (const std::size_t end : {std::size_t{0}, std::size_t{8}}) {
      const auto squared = thinned.squared_distance(0, 2, from, line.point(end));
      ASSERT_TRUE(squared) << from;
      EXPECT_NEAR(*squared, 0.0, 1e-9) << from << ", " << end;
    }
}

TEST(ThinnedManifolds, LeaveTheViewOutFromWhichTheyAreSeen) {
  // One view stands off the line: the manifold does not pass there where that view is left out.
  LineOfViews line(9, false);
  line.points(1, 4) = 1.0;
  ThinnedManifolds thinned(line.object, line.points, 2);
  EXPECT_GT(*thinned.squared_distance(0, 2, 4, line.point(4)), 0.5);
  EXPECT_NEAR(*thinned.squared_distance(0, 2, 3, line.point(4)), 0.0, 1e-9)
      << "only every second is left out";
}

TEST(ThinnedManifolds, MeasureNothingAtTheEndsOfAnOpenDofAndWithTooFewViews) {
  const LineOfViews line(9, false);
  ThinnedManifolds thinned(line.object, line.points, 2);
  EXPECT_FALSE(thinned.squared_distance(0, 2, 0, line.point(0)));
  EXPECT_FALSE(thinned.squared_distance(0, 2, 8, line.point(8)));
  EXPECT_FALSE(thinned.squared_distance(0, 4, 4, line.point(4))) << "fewer than three times four";
  const LineOfViews two(2, false);
  ThinnedManifolds of_two(two.object, two.points, 1);
  EXPECT_FALSE(of_two.squared_distance(0, 2, 1, two.point(1)));
}

TEST(MissedAt, IsWhatThinningAddsToTheFullDistanceOrMinusOneWhereItCannotBeMeasured) {
  LineOfViews line(9, false);
  line.points(1, 4) = 1.0;
  ThinnedManifolds thinned(line.object, line.points, 2);
  const Grid grid = grid_of(line.object.axes);
  const double whole = *thinned.squared_distance(0, 2, 4, line.point(4));
  const MissedErrors missed = missed_at(thinned, grid, 4, line.point(4), 0.25);
  EXPECT_DOUBLE_EQ(missed[0], whole - 0.25);
  EXPECT_EQ(missed[1], -1.0);
  EXPECT_EQ(missed[2], -1.0);
  EXPECT_EQ(missed_at(thinned, grid, 4, line.point(4), whole + 1.0)[0], 0.0) << "never less than nothing";
}

TEST(ErrorGrowth, IsExtrapolatedToTheLearnedStepWithinItsBounds) {
  const auto growth = [](const MissedErrors& missed) { return error_growth(std::span(&missed, 1)); };
  EXPECT_DOUBLE_EQ(growth({-1.0, -1.0, -1.0}), 4.0) << "cannot be measured";
  EXPECT_DOUBLE_EQ(growth({1.0, 8.0, -1.0}), 8.0);
  EXPECT_DOUBLE_EQ(growth({1.0, 8.0, 64.0}), 8.0);
  EXPECT_DOUBLE_EQ(growth({1.0, 8.0, 32.0}), 16.0) << "grows itself towards finer steps";
  EXPECT_DOUBLE_EQ(growth({1.0, 8.0, 512.0}), 8.0) << "and never falls";
  EXPECT_DOUBLE_EQ(growth({1.0, 1.5, -1.0}), 2.0);
  EXPECT_DOUBLE_EQ(growth({1.0, 1000.0, 1.0}), 64.0);
  const std::vector<MissedErrors> views{{1.0, 2.0, -1.0}, {1.0, 4.0, -1.0}, {1.0, 40.0, -1.0}};
  EXPECT_DOUBLE_EQ(error_growth(views), 4.0) << "of the medians";
}

}  // namespace
}  // namespace eigenpose
