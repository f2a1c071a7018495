#include "core/base/linear_algebra.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rounding of a few dozen additions of numbers near 1.
constexpr double kRounding = 1e-12;

/// Numbers in [-1, 1] that follow no pattern, the same on every machine.
MatrixXd scattered(Index rows, Index columns) {
  MatrixXd result(rows, columns);
  for (Index j = 0; j < columns; ++j)
    for (Index i = 0; i < rows; ++i)
      result(i, j) = std::sin(static_cast<double>(1 + 7 * i * i + 31 * j + i * j));
  return result;
}

double distance_from_identity(const MatrixXd& products) {
  return (products - MatrixXd::Identity(products.rows(), products.cols())).cwiseAbs().maxCoeff();
}

/// columns · columnsᵀ = U Σ² Uᵀ, whatever the shape.
void expect_decomposed(const MatrixXd& columns) {
  const LeftSingular found = left_singular(columns, 0.0);
  const Index thin = std::min(columns.rows(), columns.cols());
  ASSERT_EQ(found.values.size(), thin);
  ASSERT_EQ(found.vectors.rows(), columns.rows());
  ASSERT_EQ(found.vectors.cols(), thin);
  EXPECT_LT(distance_from_identity(found.vectors.transpose() * found.vectors), kRounding);
  for (Index k = 1; k < thin; ++k) EXPECT_GE(found.values[k - 1], found.values[k]);
  const MatrixXd scatter = found.vectors * found.values.cwiseAbs2().asDiagonal() * found.vectors.transpose();
  EXPECT_LT((scatter - columns * columns.transpose()).cwiseAbs().maxCoeff(), 100 * kRounding);
}

TEST(LinearAlgebra, LeftSingularVectorsRebuildTheProductsOfTallSquareAndWideColumns) {
  expect_decomposed(scattered(40, 7));
  expect_decomposed(scattered(9, 9));
  expect_decomposed(scattered(6, 20));
  expect_decomposed(scattered(5, 1));
  expect_decomposed(scattered(1, 5));
}

TEST(LinearAlgebra, LeftSingularVectorsEndAtTheLeastValue) {
  MatrixXd columns = MatrixXd::Zero(6, 3);
  columns(4, 0) = 0.5;
  columns(1, 1) = 2.0;
  columns(3, 2) = 1e-9;
  EXPECT_EQ(left_singular(columns, 0.5).vectors.cols(), 2);
  EXPECT_EQ(left_singular(columns, 0.6).vectors.cols(), 1);
  const LeftSingular all = left_singular(columns, 1e-10);
  ASSERT_EQ(all.vectors.cols(), 3);
  // The products of the columns would have lost it: (1e-9)² is below their rounding.
  EXPECT_NEAR(all.values[2], 1e-9, 1e-20);
}

TEST(LinearAlgebra, SpanLeavesOutDirectionsThatAreRoundingOfOthers) {
  MatrixXd columns = scattered(30, 4);
  columns.col(3) = columns.col(0) - 2.0 * columns.col(1);
  const MatrixXd span = orthonormal_span(columns, 1e-10);
  ASSERT_EQ(span.cols(), 3);
  EXPECT_LT(distance_from_identity(span.transpose() * span), kRounding);
  EXPECT_LT((columns - span * (span.transpose() * columns)).cwiseAbs().maxCoeff(), 100 * kRounding);
}

TEST(LinearAlgebra, SpanOfZerosIsEmpty) {
  EXPECT_EQ(orthonormal_span(MatrixXd::Zero(8, 2), 1e-10).cols(), 0);
  EXPECT_EQ(orthonormal_span(MatrixXd::Zero(8, 2), 0.0).cols(), 0);
}

TEST(LinearAlgebra, AlmostOrthonormalColumnsBecomeOrthonormalInTheirOrder) {
  // More rows than are worked on at a time, and not a multiple of them.
  const MatrixXd exact = orthonormal_span(scattered(600, 5), 1e-10);
  const MatrixXd given = exact + 1e-4 * scattered(600, 5);
  MatrixXd columns = given;
  orthonormalize_columns(columns);
  EXPECT_LT(distance_from_identity(columns.transpose() * columns), kRounding);
  // Gram-Schmidt: column k is a combination of the first k given ones, and keeps its direction.
  const MatrixXd along = columns.transpose() * given;
  for (Index j = 0; j < along.cols(); ++j) {
    EXPECT_GT(along(j, j), 0.0);
    for (Index i = j + 1; i < along.rows(); ++i) EXPECT_NEAR(along(i, j), 0.0, kRounding);
  }
}

TEST(LinearAlgebra, InverseTimesTheMatrixIsTheIdentity) {
  for (const Index size : {1, 2, 5}) {
    MatrixXd matrix = scattered(size, size);
    matrix.diagonal().array() += 2.0;
    const auto inverse = inverse_of(matrix);
    ASSERT_TRUE(inverse);
    EXPECT_LT(distance_from_identity(*inverse * matrix), kRounding);
  }
  // A first pivot of zero asks for another row, not for a refusal.
  const MatrixXd swap = MatrixXd{{0.0, 1.0}, {1.0, 0.0}};
  const auto inverse = inverse_of(swap);
  ASSERT_TRUE(inverse);
  EXPECT_EQ(*inverse, swap);
}

TEST(LinearAlgebra, NoInverseOfAMatrixThatIsSingularUpToRounding) {
  EXPECT_FALSE(inverse_of(MatrixXd::Zero(1, 1)));
  EXPECT_FALSE(inverse_of(MatrixXd::Zero(3, 3)));
  EXPECT_FALSE(inverse_of(MatrixXd{{1.0, 2.0}, {2.0, 4.0}}));
  EXPECT_FALSE(inverse_of(MatrixXd{{1.0, 0.0}, {0.0, 1e-17}}));
  EXPECT_TRUE(inverse_of(MatrixXd{{1.0, 0.0}, {0.0, 1e-12}}));
  EXPECT_FALSE(inverse_of(MatrixXd{{1.0, 0.0}, {0.0, std::numeric_limits<double>::quiet_NaN()}}));
}

TEST(LinearAlgebra, PositiveDefiniteSystemsAreSolvedAndOthersRefused) {
  const MatrixXd half = scattered(8, 8);
  const MatrixXd matrix = half * half.transpose() + MatrixXd::Identity(8, 8);
  const MatrixXd right = scattered(8, 3);
  MatrixXd work = matrix;
  const auto solved = solve_positive_definite_in_place(work, right);
  ASSERT_TRUE(solved);
  EXPECT_LT((matrix * *solved - right).cwiseAbs().maxCoeff(), 100 * kRounding);
  MatrixXd indefinite = MatrixXd{{1.0, 2.0}, {2.0, 1.0}};
  EXPECT_FALSE(solve_positive_definite_in_place(indefinite, MatrixXd::Identity(2, 2)));
}

}  // namespace
}  // namespace eigenpose
