#include "core/subspace/eigen_pairs.h"

#include <limits>

namespace eigenpose {
namespace {

double gap_after(const EigenPairs& pairs, Eigen::Index kept) {
  return pairs.values[kept - 1] - (kept < pairs.values.size() ? pairs.values[kept] : pairs.next_value);
}

}  // namespace

bool tied_cut(const EigenPairs& pairs, Eigen::Index kept) {
  return gap_after(pairs, kept) <= kEqualEigenvalues * pairs.values[0];
}

double residual_over_gap(const EigenPairs& pairs, Eigen::Index kept) {
  const double residual = pairs.residuals.head(kept).norm();
  if (tied_cut(pairs, kept)) return residual / pairs.values[kept - 1];
  const double gap =
      gap_after(pairs, kept) - (kept < pairs.values.size() ? pairs.residuals[kept] : pairs.next_residual);
  return gap > 0.0 ? residual / gap : std::numeric_limits<double>::infinity();
}

}  // namespace eigenpose
