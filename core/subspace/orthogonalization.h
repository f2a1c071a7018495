#pragma once

/// One eigenspace that holds several (the software library of Nayar, Murase, Nene, section 10).

#include <cstddef>
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

/// What is kept of the scatter S of some views about their mean: F Fᵀ. The rest, S − F Fᵀ, is positive
/// semidefinite.
struct ScatterFactor {
  Eigen::MatrixXd factor;  ///< N × C: F. Where orthogonal: eigenvectors times the roots of their eigenvalues
  Eigen::VectorXd mean;    ///< N
  std::size_t views = 0;
  double total_scatter = 0.0;  ///< trace of S
  double rest_bound = 0.0;     ///< bounds the largest eigenvalue of the rest

  /// Trace of the rest.
  [[nodiscard]] double rest() const;
  /// FᵀF, C × C, whose eigenvectors V make the columns of F V orthogonal. Cost N·C².
  [[nodiscard]] Eigen::MatrixXd products(unsigned threads) const;
  /// F W: N × K for C × K weights. Cost N·C·K.
  [[nodiscard]] Eigen::MatrixXd combined(const Eigen::MatrixXd& weights, unsigned threads) const;
};

/// Takes more views in, exactly: about the mean of all, S = S₁ + S₂ + n₁n₂/(n₁+n₂) (c₁−c₂)(c₁−c₂)ᵀ. The
/// columns of both stand side by side, and one for the means.
void join(ScatterFactor& all, const ScatterFactor& more);

/// Makes the columns orthogonal, the longest first, with the same F Fᵀ but for the shortest: of them as many
/// go as hold at most `spare` scatter together, and all that are rounding. Their squared lengths are the
/// eigenvalues of F Fᵀ. As accurate as the Gram matrix of the views. Cost 2·N·C² and O(C³). The result does
/// not depend on `threads`.
void orthogonalize(ScatterFactor& views, double spare, unsigned threads);

}  // namespace eigenpose
