#include "core/manifold/geometry.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

/// A circle of radius r in the first two of `dimensions`, by `samples` views.
Manifold circle(double radius, int samples, Eigen::Index dimensions, int degree) {
  SampleAxis axis{Dof{"table", "deg", 0.0, 360.0, true}, {}};
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(dimensions, samples);
  for (int i = 0; i < samples; ++i) {
    axis.samples.push_back(360.0 / samples * i);
    const double angle = 2.0 * std::numbers::pi * i / samples;
    points(0, i) = radius * std::cos(angle);
    points(1, i) = radius * std::sin(angle);
  }
  return Manifold::interpolate({axis}, points, degree);
}

TEST(Geometry, OfACircleIsThatOfACircle) {
  const double radius = 0.4;
  // A cubic spline of 72 samples has second derivatives good to about (2π/72)² ≈ 0.8 %.
  const Manifold f = circle(radius, 72, 5, 3);
  for (double q : {0.0, 13.0, 182.5, 359.0}) {
    const ManifoldGeometry g = curve_geometry(f, q);
    const double angle = q * std::numbers::pi / 180.0;
    EXPECT_NEAR(g.curvature, 1.0 / radius, 0.01 / radius);
    EXPECT_NEAR(g.speed, radius * std::numbers::pi / 180.0, 1e-5);
    EXPECT_NEAR(g.tangent[0], -std::sin(angle), 1e-3);
    EXPECT_NEAR(g.tangent[1], std::cos(angle), 1e-3);
    EXPECT_NEAR(g.normal[0], -std::cos(angle), 1e-2);
    EXPECT_NEAR(g.normal[1], -std::sin(angle), 1e-2);
  }
}

TEST(Geometry, HasOrthonormalTangentsThatSpanTheDerivatives) {
  std::mt19937 random(3);
  const std::vector<SampleAxis> axes = {synthetic::axis("a", 9, true, true, random),
                                        synthetic::axis("b", 5, false, false, random),
                                        synthetic::axis("c", 4, false, true, random)};
  const Manifold f = synthetic::smooth_manifold(axes, 12, 2, random, 2);
  const std::vector<double> q = {100.0, 50.0, 200.0};
  const ManifoldGeometry g = manifold_geometry(f, q, {{1.0, -0.5, 2.0}});
  ASSERT_EQ(g.tangents.cols(), 3);
  EXPECT_LT((g.tangents.transpose() * g.tangents - Eigen::MatrixXd::Identity(3, 3)).norm(), 1e-12);
  const Eigen::MatrixXd jacobian = f.evaluate_with_jacobian(q).jacobian;
  EXPECT_LT((jacobian - g.tangents * (g.tangents.transpose() * jacobian)).norm(), 1e-12);
  EXPECT_LT((g.tangents.transpose() * g.normal).norm(), 1e-10);
  EXPECT_NEAR(g.normal.norm(), 1.0, 1e-12);
}

TEST(Geometry, DoesNotDependOnTheLengthOfTheDirection) {
  std::mt19937 random(4);
  const std::vector<SampleAxis> axes = {synthetic::axis("a", 9, true, true, random),
                                        synthetic::axis("b", 5, false, false, random)};
  const Manifold f = synthetic::smooth_manifold(axes, 6, 3, random, 2);
  const ManifoldGeometry one = manifold_geometry(f, {{10.0, 20.0}}, {{0.3, 0.7}});
  const ManifoldGeometry ten = manifold_geometry(f, {{10.0, 20.0}}, {{3.0, 7.0}});
  EXPECT_NEAR(one.curvature, ten.curvature, 1e-9 * one.curvature);
  EXPECT_LT((one.normal - ten.normal).norm(), 1e-9);
  EXPECT_NEAR(10.0 * one.speed, ten.speed, 1e-12);
}

TEST(Geometry, SaysWhereNothingMoves) {
  const SampleAxis table{Dof{"table", "deg", 0.0, 360.0, true}, {0.0, 90.0, 180.0, 270.0}};
  const Manifold still = Manifold::interpolate({table}, Eigen::VectorXd::Ones(4).replicate(1, 4));
  const ManifoldGeometry g = curve_geometry(still, 20.0);
  EXPECT_LT(g.speed, 1e-15);
  EXPECT_TRUE(std::isfinite(g.curvature));
}

TEST(Geometry, RefusesDirectionsThatAreNone) {
  const Manifold f = circle(1.0, 8, 3, 2);
  EXPECT_THROW(manifold_geometry(f, {{1.0}}, {{0.0}}), std::invalid_argument);
  EXPECT_THROW(manifold_geometry(f, {{1.0}}, {{1.0, 2.0}}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
