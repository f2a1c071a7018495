#pragma once

/// What an eigen-solver found, and how sure it is.

#include <cstddef>

#include <Eigen/Core>

namespace eigenpose {

/// Two eigenvalues at the cut closer than this share of the largest one count as equal.
inline constexpr double kEqualEigenvalues = 1e-9;

/// The leading eigenpairs of a symmetric positive semidefinite operator.
struct EigenPairs {
  Eigen::VectorXd values;      ///< descending, positive; fewer than asked for where the rank is smaller
  Eigen::MatrixXd vectors;     ///< orthonormal columns
  Eigen::VectorXd residuals;   ///< ‖Q v − λ v‖, one a pair
  double next_value = 0.0;     ///< estimate of the eigenvalue after the last one
  double next_residual = 0.0;  ///< how far that estimate may be off
  bool converged = true;       ///< to the tolerance asked for
  std::size_t products = 0;    ///< blocks multiplied with the operator
};

/// ‖residuals of the first `kept` pairs‖ / (λ_kept − λ_{kept+1}), the gap taken as small as it may be: bounds
/// the sine of the largest angle to the true subspace (Davis and Kahan). Where the two eigenvalues are equal
/// every choice is right, and it is ‖residuals‖ / λ_kept. Infinite where the gap is not known to be positive.
/// @pre 0 < kept ≤ values.size().
double residual_over_gap(const EigenPairs& pairs, Eigen::Index kept);

/// The eigenvalues on both sides of the cut after `kept` are equal.
bool tied_cut(const EigenPairs& pairs, Eigen::Index kept);

}  // namespace eigenpose
