// Uncertainty of several DOFs together.
#include "core/manifold/pose_covariance.h"

#include <array>
#include <cmath>
#include <random>

#include <Eigen/QR>
#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(PoseCovariance, IsTheSpreadOfLeastSquaresEstimates) {
  // Points move by J·dq; what noise on the points does to the estimate of dq.
  Eigen::MatrixXd jacobian(6, 2);
  jacobian << 1.0, 0.9, 0.2, -0.1, -0.5, -0.7, 0.3, 0.4, 0.0, 0.2, -0.4, -0.3;
  constexpr double sigma = 0.1;
  std::array<double, 4> covariance{};
  set_covariance(jacobian.transpose() * jacobian, sigma * sigma, covariance);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0.0, sigma);
  constexpr int draws = 20000;
  Eigen::MatrixXd estimates(2, draws);
  const Eigen::MatrixXd noise = Eigen::MatrixXd::NullaryExpr(6, draws, [&] { return normal(random); });
  estimates = jacobian.householderQr().solve(noise);
  const Eigen::Matrix2d seen = estimates * estimates.transpose() / draws;
  // Tolerance: six standard errors of a variance from 20000 draws.
  for (int a = 0; a < 2; ++a)
    for (int b = 0; b < 2; ++b)
      EXPECT_NEAR(covariance[static_cast<std::size_t>(2 * a + b)], seen(a, b),
                  6.0 * std::sqrt(2.0 / draws) * std::sqrt(seen(a, a) * seen(b, b)));
  EXPECT_LT(covariance[1], 0.0) << "one makes up for the other";
}

TEST(PoseCovariance, IsInfiniteWhereNothingIsSeen) {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  information(0, 0) = 4.0;
  std::array<double, 4> covariance{};
  set_covariance(information, 1.0, covariance);
  EXPECT_NEAR(covariance[0], 0.25, 1e-12);
  EXPECT_EQ(covariance[1], 0.0);
  EXPECT_TRUE(std::isinf(covariance[3]));
  // A point that lies exactly on the manifold has no residual; what is not seen stays unknown all the same.
  set_covariance(information, 0.0, covariance);
  EXPECT_EQ(covariance[0], 0.0);
  EXPECT_TRUE(std::isinf(covariance[3]));
  std::array<double, 9> unseen{};
  set_unseen(3, unseen);
  EXPECT_TRUE(std::isinf(unseen[8]));
}

}  // namespace
}  // namespace eigenpose
