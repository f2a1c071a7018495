#include "core/base/linear_algebra.h"

#include <algorithm>

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

LeftSingular left_singular(const Eigen::Ref<const MatrixXd>& columns, double least) {
  const Index thin = std::min(columns.rows(), columns.cols());
  const Eigen::HouseholderQR<MatrixXd> qr(columns);
  const MatrixXd triangle = qr.matrixQR().topRows(thin).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd> svd(triangle, Eigen::ComputeThinU);
  Index kept = 0;
  while (kept < thin && svd.singularValues()[kept] >= least) ++kept;
  MatrixXd vectors = MatrixXd::Zero(columns.rows(), kept);
  vectors.topRows(thin) = svd.matrixU().leftCols(kept);
  vectors.applyOnTheLeft(qr.householderQ());
  return {std::move(vectors), svd.singularValues()};
}

MatrixXd orthonormal_span(const Eigen::Ref<const MatrixXd>& columns, double threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(columns);
  qr.setThreshold(threshold);
  return qr.householderQ() * MatrixXd::Identity(columns.rows(), qr.rank());
}

void orthonormalize_columns(MatrixXd& columns) {
  const MatrixXd overlap = columns.transpose() * columns;
  const Eigen::LLT<MatrixXd> factor(overlap);
  factor.matrixU().solveInPlace<Eigen::OnTheRight>(columns);
}

std::optional<VectorXd> solve_positive_definite(const Eigen::Ref<const MatrixXd>& matrix,
                                                const Eigen::Ref<const VectorXd>& right) {
  const Eigen::LLT<MatrixXd> factor(matrix);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return factor.solve(right);
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
  const Eigen::FullPivLU<MatrixXd> lu(matrix);
  if (!lu.isInvertible()) return std::nullopt;
  return lu.inverse();
}

}  // namespace eigenpose
