#pragma once

/// The leading eigenpairs of a symmetric operator that is known only by its products with blocks of vectors.

#include <cstddef>
#include <functional>
#include <stop_token>

#include <Eigen/Core>

#include "core/subspace/eigen_pairs.h"

namespace eigenpose {

/// y = Q x for a symmetric positive semidefinite Q and n × b blocks; y has the right size already.
using SymmetricProduct = std::function<void(const Eigen::MatrixXd& x, Eigen::MatrixXd& y)>;

struct KrylovOptions {
  Eigen::Index wanted = 20;        ///< K
  Eigen::Index block = 8;          ///< vectors in a product
  double tolerance = 1e-7;         ///< on `residual_over_gap`: the sine of the angle to the true subspace
  Eigen::Index max_vectors = 400;  ///< basis size before a restart; at least K + 1 + 3 blocks
  std::size_t max_products = 500;  ///< give up after so many blocks
  /// Eigenvalues at most this are rounding and count as zero; they need not converge and are not returned.
  double noise = 0.0;
};

/// Block Krylov (block Lanczos) with full re-orthogonalisation, Rayleigh-Ritz on the whole basis, and thick
/// restarts.
///
/// Repeated eigenvalues: from b random vectors a Krylov space sees at most b copies of one eigenvalue. So
/// whenever the found values hold a cluster as large as the number of random vectors so far, more random
/// vectors join, until that number exceeds every cluster. Start vectors are fixed by a seed: the same
/// operator gives the same answer. Memory 16·n·max_vectors bytes. @throws Interrupted.
EigenPairs leading_eigenpairs(Eigen::Index size, const SymmetricProduct& product,
                              const KrylovOptions& options, const std::stop_token& stop = {});

}  // namespace eigenpose
