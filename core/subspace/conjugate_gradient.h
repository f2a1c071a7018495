#pragma once

/// The leading eigenpairs of a symmetric operator by conjugate gradients, one after another (eq. 19–20,
/// appendix A of Nayar, Murase, Nene).

#include <cstddef>
#include <stop_token>

#include <Eigen/Core>

#include "core/subspace/block_krylov.h"

namespace eigenpose {

struct ConjugateGradientOptions {
  Eigen::Index wanted = 20;           ///< K
  double tolerance = 1e-9;            ///< on ‖Q e − F e‖ / λ₁
  std::size_t max_iterations = 2000;  ///< for each eigenvector
  double noise = 0.0;                 ///< eigenvalues at most this are rounding: the search ends there
};

/// Maximises the Rayleigh quotient F(e) = eᵀQe / eᵀe. The direction is d = g + β d with g = Q e − F e and β
/// of Polak and Ribière, never negative; the line search is exact: the larger eigenvalue of the 2 × 2 problem
/// on span{e, d}. Found eigenvectors are deflated: Q v − Σ λᵢ eᵢ (eᵢᵀ v), and every vector is made orthogonal
/// to them. One more than K is searched, for the gap, and Rayleigh-Ritz over all of them ends it. One product
/// an iteration; memory 16·n·K bytes. Repeated eigenvalues are found one after another. @throws Interrupted.
EigenPairs conjugate_gradient_eigenpairs(Eigen::Index size, const SymmetricProduct& product,
                                         const ConjugateGradientOptions& options,
                                         const std::stop_token& stop = {});

}  // namespace eigenpose
