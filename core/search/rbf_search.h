#pragma once

/// Networks in the place of a search: the object with the largest output, at the pose that its network says.

#include "core/search/rbf_network.h"
#include "core/search/search.h"

namespace eigenpose {

/// Approximate: the answers are near the closest points where the point is like a learned view; distances are
/// true distances to f at the pose found. The first answer is the network's choice, also where another's
/// distance is smaller.
class RbfSearch final : public ManifoldSearch {
 public:
  /// @throws std::invalid_argument for an empty list or unequal K.
  explicit RbfSearch(std::span<const Manifold> manifolds, const RbfOptions& options = {});

  /// Beyond `bound` nothing is said. Allocates.
  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "rbf"; }
  [[nodiscard]] std::size_t memory() const override;
  [[nodiscard]] const RbfRecognizer& networks() const { return networks_; }

 private:
  RbfRecognizer networks_;
};

}  // namespace eigenpose
