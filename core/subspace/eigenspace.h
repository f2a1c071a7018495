#pragma once

/// The eigenspace: mean, orthonormal basis and eigenvalues of a set of appearances (eq. 4–7).

#include <Eigen/Core>

namespace eigenpose {

/// A K-dimensional linear subspace of the N-dimensional appearances.
///
/// Invariants: basisᵀ basis = I within 1e-5; eigenvalues descend and are ≥ 0; in every basis vector the entry
/// of the largest magnitude is positive, so that learning twice gives the same file.
struct Eigenspace {
  Eigen::VectorXf mean;         ///< N
  Eigen::MatrixXf basis;        ///< N × K, one column an eigenvector
  Eigen::VectorXd eigenvalues;  ///< K, of the M×M scatter PᵀP (sums over views, not averages)
  double total_scatter = 0.0;  ///< trace of the scatter: eigenvalues.sum() / total_scatter is the energy kept

  [[nodiscard]] Eigen::Index length() const { return basis.rows(); }      ///< N
  [[nodiscard]] Eigen::Index components() const { return basis.cols(); }  ///< K

  /// basisᵀ (appearance − mean): K numbers. @throws std::invalid_argument unless appearance.size() == N.
  [[nodiscard]] Eigen::VectorXf project(const Eigen::Ref<const Eigen::VectorXf>& appearance) const;
};

}  // namespace eigenpose
