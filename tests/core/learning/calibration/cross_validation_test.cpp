#include "core/learning/calibration/cross_validation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

/// Views at the values of one DOF of range 0…8.
ObjectViews views_along(const std::vector<double>& values, bool periodic) {
  const Dof dof{"x", "mm", 0.0, 8.0, periodic};
  ObjectViews object;
  object.workspace = Workspace({dof});
  object.axes = {{dof, values}};
  object.count = values.size();
  return object;
}

TEST(CrossValidation, LeavesEveryValueOfATurnOutOnceAndTheEndsOfAnOpenDofNever) {
  for (const bool periodic : {true, false}) {
    const std::vector<double> values{0.0, 1.0, 2.0, 3.5, 5.0, 6.0, 7.0};
    std::vector<int> left_out(values.size(), 0);
    const auto folds = make_folds(views_along(values, periodic), 0);
    ASSERT_EQ(folds.size(), 2U);
    for (const Fold& fold : folds) {
      EXPECT_EQ(fold.kept.size() + fold.left_out.size(), values.size());
      std::vector<double> kept;
      for (const Eigen::Index view : fold.kept) kept.push_back(values[static_cast<std::size_t>(view)]);
      EXPECT_EQ(fold.axes[0].samples, kept);
      for (std::size_t i = 0; i < fold.left_out.size(); ++i) {
        const auto view = static_cast<std::size_t>(fold.left_out[i]);
        ++left_out[view];
        EXPECT_EQ(fold.left_out_values[i], values[view]);
      }
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      const bool end = i == 0 || i + 1 == values.size();
      EXPECT_EQ(left_out[i], periodic || !end ? 1 : 0) << i;
    }
  }
}

TEST(CrossValidation, NeedsSixValuesOfATurnAndFiveOfAnOpenDof) {
  EXPECT_TRUE(make_folds(views_along({0, 1, 2, 3, 4}, true), 0).empty());
  EXPECT_EQ(make_folds(views_along({0, 1, 2, 3, 4, 5}, true), 0).size(), 2U);
  EXPECT_TRUE(make_folds(views_along({0, 1, 2, 3}, false), 0).empty());
  EXPECT_EQ(make_folds(views_along({0, 1, 2, 3, 4}, false), 0).size(), 2U);
}

TEST(CrossValidation, FindsLeftOutViewsWhereTheyStandOnALineAndAcrossTheSeamOfACircle) {
  const auto errors_of = [](bool periodic, const auto& point_at) {
    const std::vector<double> values{0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0};
    const ObjectViews object = views_along(values, periodic);
    const auto points = [&](const std::vector<Eigen::Index>& views) {
      Eigen::MatrixXd columns(2, static_cast<Eigen::Index>(views.size()));
      for (Eigen::Index i = 0; i < columns.cols(); ++i)
        columns.col(i) = point_at(values[static_cast<std::size_t>(views[static_cast<std::size_t>(i)])]);
      return columns;
    };
    return left_out_errors(object, 0, 2, [&](const Fold& fold) {
      return FoldPoints{points(fold.kept), points(fold.left_out)};
    });
  };
  const auto on_a_line = errors_of(false, [](double x) { return Eigen::Vector2d(3.0 * x, -x); });
  ASSERT_EQ(on_a_line.size(), 6U);
  EXPECT_LT(*std::ranges::max_element(on_a_line), 1e-4);
  const auto on_a_circle = errors_of(true, [](double x) {
    const double angle = 0.25 * std::numbers::pi * x;
    return Eigen::Vector2d(std::cos(angle), std::sin(angle));
  });
  ASSERT_EQ(on_a_circle.size(), 8U);
  EXPECT_LT(*std::ranges::max_element(on_a_circle), 1e-3);
}

}  // namespace
}  // namespace eigenpose
