#include "core/subspace/block_krylov.h"

#include <random>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/base/linear_algebra.h"
#include "tests/core/subspace/subspace_samples.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A symmetric matrix with the given eigenvalues and random eigenvectors.
struct KnownMatrix {
  MatrixXd matrix, vectors;
  explicit KnownMatrix(const VectorXd& values) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    MatrixXd noise(values.size(), values.size());
    for (double& x : noise.reshaped()) x = normal(random);
    vectors = orthonormal_span(noise, 1e-12);
    matrix = vectors * values.asDiagonal() * vectors.transpose();
    matrix = (0.5 * (matrix + matrix.transpose())).eval();
  }
  [[nodiscard]] SymmetricProduct product() const {
    return [this](const MatrixXd& x, MatrixXd& y) { y = matrix * x; };
  }
};

VectorXd decaying(Index size) {
  VectorXd values(size);
  for (Index i = 0; i < size; ++i) values[i] = 100.0 / static_cast<double>((i + 1) * (i + 1));
  return values;
}

TEST(BlockKrylov, FindsTheLeadingPairs) {
  const KnownMatrix known(decaying(300));
  const EigenPairs found = leading_eigenpairs(300, known.product(), {.wanted = 12});
  ASSERT_TRUE(found.converged);
  EXPECT_LE(residual_over_gap(found, 12), 1e-7);
  for (Index k = 0; k < 12; ++k) EXPECT_NEAR(found.values[k], decaying(300)[k], 1e-10);
  EXPECT_NEAR(found.next_value, decaying(300)[12], 0.1);
  // The reported bound is a sine: it must hold. The floor is the rounding of the comparison in float.
  EXPECT_LT(test::largest_angle_deg(found.vectors.cast<float>(), known.vectors.leftCols(12).cast<float>()),
            1e-4);
}

TEST(BlockKrylov, FindsEveryCopyOfAnEigenvalueRepeatedMoreOftenThanTheBlockIsWide) {
  VectorXd values = decaying(200);
  values.segment(2, 13).setConstant(9.0);
  std::sort(values.begin(), values.end(), std::greater<>());
  const KnownMatrix known(values);
  const EigenPairs found = leading_eigenpairs(200, known.product(), {.wanted = 15, .block = 2});
  ASSERT_TRUE(found.converged);
  for (Index k = 0; k < 15; ++k) EXPECT_NEAR(found.values[k], values[k], 1e-9) << k;
  EXPECT_LT(test::largest_angle_deg(found.vectors.cast<float>(), known.vectors.leftCols(15).cast<float>()),
            1e-4);
}

TEST(BlockKrylov, ReportsATieAtTheCutWhereTheBlockIsAsWideAsIsWanted) {
  // A space from b vectors sees b copies. Their number being b, there may be more: the next value is as
  // large.
  VectorXd values = 0.01 * decaying(200);
  values.head(5).setConstant(9.0);
  const KnownMatrix known(values);
  for (const Index wanted : {1, 2, 3, 4}) {
    const EigenPairs found =
        leading_eigenpairs(200, known.product(), {.wanted = wanted, .block = wanted, .tolerance = 1e-3});
    ASSERT_TRUE(found.converged);
    ASSERT_EQ(found.values.size(), wanted);
    EXPECT_NEAR(found.values[wanted - 1], 9.0, 1e-6);
    EXPECT_NEAR(found.next_value, 9.0, 1e-6) << wanted;
    EXPECT_TRUE(tied_cut(found, wanted));
  }
}

TEST(BlockKrylov, AcceptsAllEigenvaluesEqual) {
  const KnownMatrix known(VectorXd::Ones(120));
  const EigenPairs found = leading_eigenpairs(120, known.product(), {.wanted = 10, .block = 3});
  ASSERT_TRUE(found.converged);
  ASSERT_EQ(found.values.size(), 10);
  EXPECT_LT((found.values - VectorXd::Ones(10)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(BlockKrylov, ReturnsTheRankWhereItIsSmallerThanAskedFor) {
  VectorXd values = VectorXd::Zero(150);
  values.head(6) << 5, 4, 4, 4, 4, 1;
  const KnownMatrix known(values);
  const EigenPairs found =
      leading_eigenpairs(150, known.product(), {.wanted = 20, .block = 3, .noise = 1e-10});
  ASSERT_TRUE(found.converged);
  ASSERT_EQ(found.values.size(), 6);
  EXPECT_LT(test::largest_angle_deg(found.vectors.cast<float>(), known.vectors.leftCols(6).cast<float>()),
            1e-4);
}

TEST(BlockKrylov, ConvergesThroughRestarts) {
  // A slow decay and little room: several restarts.
  VectorXd values(400);
  for (Index i = 0; i < 400; ++i) values[i] = 10.0 - 0.02 * static_cast<double>(i);
  const KnownMatrix known(values);
  const EigenPairs found =
      leading_eigenpairs(400, known.product(), {.wanted = 5, .block = 4, .max_vectors = 60});
  ASSERT_TRUE(found.converged);
  EXPECT_GT(found.products, 15U) << "no restart was needed: the test shows nothing";
  EXPECT_LT(test::largest_angle_deg(found.vectors.cast<float>(), known.vectors.leftCols(5).cast<float>()),
            1e-4);
}

TEST(BlockKrylov, SaysWhenItGaveUp) {
  const KnownMatrix known(VectorXd::LinSpaced(400, 10.0, 9.0));
  const EigenPairs found =
      leading_eigenpairs(400, known.product(), {.wanted = 5, .block = 4, .max_products = 6});
  EXPECT_FALSE(found.converged);
  EXPECT_EQ(found.products, 6U);
}

TEST(BlockKrylov, StopsOnRequest) {
  const KnownMatrix known(decaying(100));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(leading_eigenpairs(100, known.product(), {.wanted = 5}, stop.get_token()), Interrupted);
}

}  // namespace
}  // namespace eigenpose
