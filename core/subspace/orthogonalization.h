#pragma once

/// One eigenspace that holds several (the software library of Nayar, Murase, Nene, section 10).

#include <span>

#include <Eigen/Core>

#include "core/subspace/eigenspace.h"

namespace eigenpose {

/// An orthonormal basis of the sum of the column spans.
struct OrthogonalizedBasis {
  Eigen::MatrixXf basis;            ///< N × R, descending singular values
  Eigen::VectorXd singular_values;  ///< all, of [E₁ … E_P]: from √P (a direction that all share) down
};

/// By the singular values of [E₁ … E_P]: left singular vectors with σ ≥ tau. For orthonormal Eᵢ σ² lies in
/// [0, P]; a direction dropped for σ < tau was within asin(tau) of the others' span. Cost N·C² for C columns
/// in all.
/// @param tau in (0, 1). @throws std::invalid_argument for no matrix, different N, or tau outside.
OrthogonalizedBasis orthogonalize(std::span<const Eigen::MatrixXf> bases, double tau = 1e-3);

/// The eigenspace that holds several: its mean is the mean of the means, its basis spans all bases and the
/// differences of the means (unit vectors there), up to directions with σ < tau. Eigenvalues are the scatter
/// of the given spaces along the new directions (Σ Eᵢ Λᵢ Eᵢᵀ, diagonal in the new basis, descending; zero
/// along pure differences of means).
/// @throws std::invalid_argument as above.
Eigenspace orthogonalize(std::span<const Eigenspace> spaces, double tau = 1e-3);

}  // namespace eigenpose
