#include "core/search/rbf_network.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

TEST(RbfNetwork, MeetsItsBoundAtTheSamples) {
  std::mt19937 random(41);
  const Eigen::MatrixXd points = synthetic::random_matrix(4, 80, random);
  Eigen::MatrixXd targets(2, 80);
  targets.row(0) = points.row(0).array().sin();
  targets.row(1) = points.row(1).array() * points.row(2).array();
  for (double bound : {0.3, 0.1, 0.02}) {
    RbfOptions options;
    options.max_error = bound;
    RbfReport report;
    const RbfNetwork network = RbfNetwork::fit(points, targets, options, &report);
    EXPECT_TRUE(report.bound_met);
    EXPECT_EQ(report.units, network.units());
    double worst = 0.0;
    for (Eigen::Index i = 0; i < points.cols(); ++i)
      worst = std::max(worst, (network.evaluate(points.col(i)) - targets.col(i)).cwiseAbs().maxCoeff());
    EXPECT_LE(worst, bound * (1.0 + 1e-9));
    EXPECT_NEAR(worst, report.largest_error, 1e-9);
  }
}

TEST(RbfNetwork, NeedsMoreUnitsForATighterBoundAndNoneForAConstant) {
  std::mt19937 random(42);
  const Eigen::MatrixXd points = synthetic::random_matrix(3, 60, random);
  const Eigen::MatrixXd targets = points.row(0).array().sin();
  RbfOptions loose;
  loose.max_error = 0.4;
  RbfOptions tight;
  tight.max_error = 0.01;
  EXPECT_LT(RbfNetwork::fit(points, targets, loose).units(), RbfNetwork::fit(points, targets, tight).units());
  EXPECT_EQ(RbfNetwork::fit(points, Eigen::MatrixXd::Constant(1, 60, 0.7), tight).units(), 0U);
}

TEST(RbfNetwork, UsesOneUnitForOneBump) {
  std::mt19937 random(43);
  const Eigen::MatrixXd points = synthetic::random_matrix(3, 50, random);
  RbfOptions options;
  options.max_error = 1e-4;
  options.widths = 1;
  RbfReport report;
  // A target that is a unit of the ladder itself: fitted on one, found again by any number.
  Eigen::MatrixXd targets = Eigen::MatrixXd::Zero(1, 50);
  targets(0, 7) = 1.0;
  options.max_units = 1;
  const RbfNetwork one = RbfNetwork::fit(points, targets, options, &report);
  Eigen::MatrixXd bump(1, 50);
  for (Eigen::Index i = 0; i < 50; ++i) bump(0, i) = one.evaluate(points.col(i))[0];
  options.max_units = 0;
  EXPECT_EQ(RbfNetwork::fit(points, bump, options, &report).units(), 1U);
  EXPECT_TRUE(report.bound_met);
}

TEST(RbfRecognizer, NamesObjectAndPoseBetweenTheSamples) {
  std::mt19937 random(44);
  std::vector<Manifold> list;
  for (int i = 0; i < 6; ++i)
    list.push_back(
        synthetic::smooth_manifold({synthetic::axis("table", 36, true, false, random)}, 12, 2, random, 3));
  const RbfRecognizer networks(list);
  EXPECT_EQ(networks.unmet(), 0U);
  int right = 0;
  double error = 0.0;
  int asked = 0;
  for (std::size_t object = 0; object < list.size(); ++object)
    for (int i = 0; i < 36; ++i) {
      const double angle = 10.0 * i + 5.0;
      const auto estimate = networks.recognize(list[object].evaluate({{angle}}));
      ++asked;
      if (estimate.manifold != object) continue;
      ++right;
      const double difference = list[object].axes()[0].dof.difference(estimate.q[0], angle);
      error += std::abs(difference);
      EXPECT_GE(estimate.q[0], 0.0);
      EXPECT_LT(estimate.q[0], 360.0);
    }
  // The paper calls networks comparable, slightly less accurate: nearly all objects, poses well within the
  // 10° spacing.
  EXPECT_GE(right, asked * 95 / 100);
  EXPECT_LT(error / right, 3.0);
}

TEST(RbfRecognizer, LearnsAnOpenAxisBesideAPeriodicOne) {
  std::mt19937 random(45);
  const std::vector<Manifold> list = {synthetic::smooth_manifold(
      {synthetic::axis("table", 12, true, false, random), synthetic::axis("x", 5, false, false, random)}, 10,
      2, random, 1)};
  const RbfRecognizer networks(list);
  for (double table : {0.0, 90.0, 330.0})
    for (double x : {0.0, 90.0, 360.0}) {
      const auto q = networks.pose(0, list[0].evaluate({{table, x}}));
      ASSERT_EQ(q.size(), 2U);
      // 0.03 of cos and sin is at most 2.5°; 0.03 of −1…1 over 360 is 5.4.
      EXPECT_LT(std::abs(list[0].axes()[0].dof.difference(q[0], table)), 2.5);
      EXPECT_NEAR(q[1], x, 5.5);
    }
}

TEST(RbfRecognizer, NamesPosesWithinTheRangeOfAnOpenAxisAlone) {
  std::mt19937 random(46);
  const std::vector<Manifold> list = {
      synthetic::smooth_manifold({synthetic::axis("x", 7, false, false, random)}, 8, 2, random, 1)};
  const RbfRecognizer networks(list);
  const Dof& dof = list[0].axes()[0].dof;
  std::normal_distribution<double> noise(0.0, 0.3);
  int at_an_end = 0;
  for (int i = 0; i < 300; ++i) {
    Eigen::VectorXd point = list[0].evaluate({{i % 2 == 0 ? dof.lower : dof.upper}});
    for (double& value : point) value += noise(random);
    const double q = networks.pose(0, point)[0];
    EXPECT_GE(q, dof.lower);
    EXPECT_LE(q, dof.upper);
    at_an_end += q == dof.lower || q == dof.upper ? 1 : 0;
  }
  EXPECT_GT(at_an_end, 0) << "or no output is beyond the range";
}

TEST(RbfNetwork, RefusesWhatDoesNotFit) {
  EXPECT_THROW(RbfNetwork::fit(Eigen::MatrixXd::Zero(2, 3), Eigen::MatrixXd::Zero(1, 4)),
               std::invalid_argument);
  EXPECT_THROW(RbfNetwork::fit(Eigen::MatrixXd::Zero(2, 0), Eigen::MatrixXd::Zero(1, 0)),
               std::invalid_argument);
  RbfOptions options;
  options.max_error = 0.0;
  EXPECT_THROW(RbfNetwork::fit(Eigen::MatrixXd::Zero(2, 3), Eigen::MatrixXd::Zero(1, 3), options),
               std::invalid_argument);
  EXPECT_THROW(RbfRecognizer({}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
