#pragma once

/// Decompositions of dense matrices in double.
///
/// Eigen's decompositions are templates that compile for seconds wherever they are named, and again for each
/// type of argument. Here few of them are compiled once, for one type. Only linear_algebra.cpp includes their
/// headers; everybody else includes <Eigen/Core> and this.

#include <optional>

#include <Eigen/Core>

namespace eigenpose {

/// Eigenvalues (descending) of a symmetric matrix and orthonormal eigenvectors, one a column.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// By tridiagonalisation and implicit QR, O(n³). Only the lower triangle of `matrix` (n × n) is read.
SymmetricEigen symmetric_eigen(const Eigen::Ref<const Eigen::MatrixXd>& matrix);

/// Left singular vectors of a matrix, one a column, and its singular values (descending).
struct LeftSingular {
  Eigen::MatrixXd vectors;  ///< rows × kept
  Eigen::VectorXd values;   ///< all min(rows, columns) of them
};

/// Singular vectors with a singular value ≥ `least`, O(rows · columns²). QR goes first: the SVD is then of a
/// small triangle, and small singular values keep their digits, which the product of the columns would lose.
LeftSingular left_singular(const Eigen::Ref<const Eigen::MatrixXd>& columns, double least);

/// An orthonormal basis of the columns' span: the left singular vectors whose singular value is at least
/// `threshold` times the largest and not zero.
Eigen::MatrixXd orthonormal_span(const Eigen::Ref<const Eigen::MatrixXd>& columns, double threshold);

/// Gram-Schmidt in the order of the columns, by Cholesky of their products: for columns that are almost
/// orthonormal already.
void orthonormalize_columns(Eigen::MatrixXd& columns);

/// The solution of a symmetric positive definite system for each right side (Cholesky); none where the matrix
/// is not positive definite. Only the lower triangle of `matrix` is read; it is overwritten.
std::optional<Eigen::MatrixXd> solve_positive_definite_in_place(
    Eigen::MatrixXd& matrix, const Eigen::Ref<const Eigen::MatrixXd>& right);

/// Solution and inverse of a symmetric positive semidefinite system, LDLᵀ with pivoting.
struct SymmetricSolution {
  Eigen::MatrixXd solution;
  Eigen::MatrixXd inverse;
};
SymmetricSolution solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                                  const Eigen::Ref<const Eigen::MatrixXd>& right);

/// The solution of a square invertible system, LU with row pivoting.
Eigen::MatrixXd solve_square(const Eigen::Ref<const Eigen::MatrixXd>& matrix,
                             const Eigen::Ref<const Eigen::MatrixXd>& right);

/// The inverse of a square matrix (LU with row pivoting); none where it is not finite or singular up to
/// rounding: where its condition number ‖A‖ ‖A⁻¹‖ times n times the machine's precision reaches 1.
std::optional<Eigen::MatrixXd> inverse_of(const Eigen::Ref<const Eigen::MatrixXd>& matrix);

}  // namespace eigenpose
