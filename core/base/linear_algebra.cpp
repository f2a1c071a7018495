#include "core/base/linear_algebra.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace eigenpose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SymmetricEigen symmetric_eigen(const Eigen::Ref<const MatrixXd>& matrix) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(matrix);
  return {solver.eigenvalues().reverse(), solver.eigenvectors().rowwise().reverse()};
}

namespace {

/// R of columns = Q R, square: one row a column.
MatrixXd square_triangle(const Eigen::HouseholderQR<MatrixXd>& qr) {
  return qr.matrixQR().topRows(qr.cols()).triangularView<Eigen::Upper>();
}

/// Left singular vectors whose singular values are at least max(least, relative · largest value).
LeftSingular left_singular_above(const Eigen::Ref<const MatrixXd>& columns, double least, double relative) {
  // Of a square matrix, so that no further QR is compiled to make it one.
  using Svd = Eigen::JacobiSVD<MatrixXd, Eigen::NoQRPreconditioner>;
  const bool wide = columns.cols() > columns.rows();
  const Eigen::HouseholderQR<MatrixXd> qr(wide ? MatrixXd(columns.transpose()) : MatrixXd(columns));
  // Of a wide matrix Rᵀ Qᵀ, the left vectors are those of Rᵀ; of a tall one Q R, they are Q times those of R.
  MatrixXd triangle = square_triangle(qr);
  if (wide) triangle.transposeInPlace();
  const Svd svd(triangle, Eigen::ComputeFullU);
  const VectorXd& values = svd.singularValues();
  const double bound = values.size() == 0 ? least : std::max(least, relative * values[0]);
  Index kept = 0;
  while (kept < values.size() && values[kept] >= bound) ++kept;
  if (wide) return {svd.matrixU().leftCols(kept), values};
  MatrixXd vectors = MatrixXd::Zero(columns.rows(), kept);
  vectors.topRows(columns.cols()) = svd.matrixU().leftCols(kept);
  vectors.applyOnTheLeft(qr.householderQ());
  return {std::move(vectors), values};
}

/// The matrix norm that goes with the 1-norm of vectors; no number where an element is none.
double largest_column_sum(const Eigen::Ref<const MatrixXd>& matrix) {
  return matrix.cwiseAbs().colwise().sum().maxCoeff<Eigen::PropagateNaN>();
}

}  // namespace

LeftSingular left_singular(const Eigen::Ref<const MatrixXd>& columns, double least) {
  return left_singular_above(columns, least, 0.0);
}

MatrixXd orthonormal_span(const Eigen::Ref<const MatrixXd>& columns, double threshold) {
  // A matrix of zeros spans nothing: its largest singular value, 0, is no direction.
  return left_singular_above(columns, std::numeric_limits<double>::min(), threshold).vectors;
}

void orthonormalize_columns(MatrixXd& columns) {
  MatrixXd overlap = columns.transpose() * columns;
  const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(overlap);
  // Rows of columns · L⁻ᵀ, some at a time: the transposed copy stays small.
  constexpr Index tile = 256;
  for (Index row = 0; row < columns.rows(); row += tile) {
    const Index rows = std::min(tile, columns.rows() - row);
    MatrixXd turned = columns.middleRows(row, rows).transpose();
    factor.matrixL().solveInPlace(turned);
    columns.middleRows(row, rows) = turned.transpose();
  }
}

std::optional<MatrixXd> solve_positive_definite_in_place(MatrixXd& matrix,
                                                         const Eigen::Ref<const MatrixXd>& right) {
  const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(matrix);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return factor.solve(right);
}

SymmetricSolution solve_symmetric(const Eigen::Ref<const MatrixXd>& matrix,
                                  const Eigen::Ref<const MatrixXd>& right) {
  const Eigen::LDLT<MatrixXd> factor(matrix);
  return {factor.solve(right), factor.solve(MatrixXd::Identity(matrix.rows(), matrix.cols()))};
}

MatrixXd solve_square(const Eigen::Ref<const MatrixXd>& matrix, const Eigen::Ref<const MatrixXd>& right) {
  return matrix.partialPivLu().solve(right);
}

std::optional<MatrixXd> inverse_of(const Eigen::Ref<const MatrixXd>& matrix) {
  const Index size = matrix.rows();
  MatrixXd inverse = solve_square(matrix, MatrixXd::Identity(size, size));
  // ‖A‖ ‖A⁻¹‖, largest sums of columns. A pivot of zero leaves infinities or no numbers at all.
  const double condition = largest_column_sum(matrix) * largest_column_sum(inverse);
  const double rounding = static_cast<double>(size) * std::numeric_limits<double>::epsilon();
  if (!(condition * rounding < 1.0)) return std::nullopt;
  return inverse;
}

}  // namespace eigenpose
