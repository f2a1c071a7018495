#pragma once

/// Exact global closest point on the continuous manifolds: one wide tree of boxes over all segments and
/// patches.
///
/// A box holds its patch by the convex-hull property of Bernstein polynomials, rounded outward to float. A
/// node is 16 boxes, compared with the point at once. The search goes depth first, nearest box first, and
/// leaves out what cannot come within the best distance so far (or the caller's bound), less a slack for
/// float rounding.
///
/// Guarantee: no point of any manifold is nearer than the answer by more than rounding (m = 1) or
/// `patch_distance_tolerance` (m ≥ 2). The slack makes leaving out safe: a sum of K squares in float is wrong
/// by less than (K+3)·2⁻²⁴ of itself, and a box is left out only where its float distance exceeds the best by
/// (4K+32)·2⁻²⁴.

#include "core/search/patch_set.h"
#include "core/search/search.h"
#include "core/simd/box_distances.h"

namespace eigenpose {

/// The default search. Memory: 2·K floats per patch for the boxes, and the scalars of PatchSet.
class TreeSearch final : public ManifoldSearch {
 public:
  explicit TreeSearch(std::span<const Manifold> manifolds);

  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "tree"; }
  [[nodiscard]] std::size_t memory() const override;

 private:
  struct Node {
    std::uint32_t first = 0;  ///< number of the first child node, or of the first entry of `order_`
    std::uint32_t count = 0;  ///< children in use, at most box_lanes
  };
  void run(const float* point, const double* exact, class BestList& best) const;
  void build(std::span<const float> boxes);

  PatchSet patches_;
  std::size_t first_leaf_ = 0;        ///< nodes from here on have patches as children
  std::vector<Node> nodes_;           ///< level by level, the root first
  std::vector<BoxSlice> slices_;      ///< K per node
  std::vector<std::uint32_t> order_;  ///< patches as the lowest nodes hold them
};

}  // namespace eigenpose
