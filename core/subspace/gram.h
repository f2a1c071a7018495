#pragma once

/// The Gram matrix of a set of appearances (Murakami and Kumar; eq. 21): exact where the views are 8-bit.

#include <cstddef>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// Inner products of some views of a source, known from before: so objects join and leave an eigenspace
/// without the work of learning it anew. Joining m views to M costs (M·m + m²/2)·N multiplications, leaving
/// none.
///
/// Nothing is lost by it: each product depends on its two views alone, so the eigenspace is bit for bit the
/// one that is learned anew. (Keeping a truncated basis instead of the products would be smaller, but its
/// error is the discarded singular value over the eigenvalue gap, which no useful truncation keeps small.)
struct KnownProducts {
  Eigen::MatrixXd products;        ///< as `gram_matrix` gave them
  std::vector<Eigen::Index> rows;  ///< of every view of the source: its row in `products`, or −1
};

struct GramOptions {
  unsigned threads = 0;         ///< 0 means all cores; the result does not depend on it
  std::size_t tile_memory = 0;  ///< bytes for views read from a source that is not resident; 0 means no limit
  const KnownProducts* known = nullptr;  ///< taken from here where they stand there
};

/// All inner products of a source's views, unscaled where they are bytes: M × M, full and symmetric; exact
/// integers for bytes, sums in double for floats. Every entry depends on its two views alone: not on threads,
/// tiles, order, or (in floats too) the SIMD target. Cost
/// M²N/2 multiplications, 8M² bytes, and the views once if `tile_memory` holds them all; if it holds the
/// share 1/s of them, about (s+1)/2 times. @throws std::invalid_argument when `tile_memory` holds fewer than
/// two views, or known products do not fit the source; Interrupted.
Eigen::MatrixXd gram_matrix(const AppearanceSource& source, const GramOptions& options,
                            const Progress& progress = {}, std::stop_token stop = {});

/// ‖xⱼ‖ of every view, from the diagonal, for bytes; ones for floats, which are scaled already.
/// @throws std::invalid_argument naming the view without energy.
Eigen::VectorXd view_norms(const Eigen::MatrixXd& gram, bool bytes);

/// Turns inner products into those of the centred unit-energy appearances, in place: J D⁻¹ G D⁻¹ J with D the
/// norms and J = I − 11ᵀ/M. @return its trace: the total scatter.
double normalize_and_center(Eigen::MatrixXd& gram, const Eigen::VectorXd& norms, unsigned threads);

}  // namespace eigenpose
