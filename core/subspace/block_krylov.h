#pragma once

/// The leading eigenpairs of a symmetric operator that is known only by its products with blocks of vectors.

#include <cstddef>
#include <functional>
#include <stop_token>

#include <Eigen/Core>

namespace eigenpose {

/// Two eigenvalues at the cut closer than this share of the largest one count as equal.
inline constexpr double kEqualEigenvalues = 1e-9;

/// y = Q x for a symmetric positive semidefinite Q and n × b blocks; y has the right size already.
using SymmetricProduct = std::function<void(const Eigen::MatrixXd& x, Eigen::MatrixXd& y)>;

struct KrylovOptions {
  Eigen::Index wanted = 20;        ///< K
  Eigen::Index block = 8;          ///< vectors in a product
  double tolerance = 1e-7;         ///< bound on residual / gap: the sine of the angle to the true subspace
  Eigen::Index max_vectors = 400;  ///< basis size before a restart; at least K + 1 + 3 blocks
  std::size_t max_products = 500;  ///< give up after so many blocks
  /// Eigenvalues at most this are rounding and count as zero; they need not converge and are not returned.
  double noise = 0.0;
};

struct KrylovResult {
  Eigen::VectorXd values;     ///< descending, all above `noise`; fewer than K where the rank is smaller
  Eigen::MatrixXd vectors;    ///< orthonormal columns
  Eigen::VectorXd residuals;  ///< ‖Q v − λ v‖, one a pair
  double next_value = 0.0;    ///< the eigenvalue after the last one returned
  /// ‖residuals‖ / (λ_K − λ_{K+1}): bounds the sine of the largest angle to the true subspace (Davis and
  /// Kahan). Where the two are equal within 1e-9 λ₁ every choice is right, and it is ‖residuals‖ / λ_K.
  double residual_over_gap = 0.0;
  bool converged = false;
  std::size_t products = 0;  ///< blocks multiplied
};

/// Block Krylov (block Lanczos) with full re-orthogonalisation, Rayleigh-Ritz on the whole basis, and thick
/// restarts.
///
/// Repeated eigenvalues: from b random vectors a Krylov space sees at most b copies of one eigenvalue. So
/// whenever the found values hold a cluster as large as the number of random vectors so far, more random
/// vectors join, until that number exceeds every cluster. Start vectors are fixed by a seed: the same
/// operator gives the same answer. Memory 16·n·max_vectors bytes. @throws Interrupted.
KrylovResult leading_eigenpairs(Eigen::Index size, const SymmetricProduct& product,
                                const KrylovOptions& options, std::stop_token stop = {});

}  // namespace eigenpose
