#pragma once

/// A region seen in the objects' own eigenspaces: how well each explains the whole picture, and at which
/// pose.

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/model/model.h"
#include "core/search/search.h"

namespace eigenpose {

/// A region reduced as the objects' own eigenspaces take it, and scratch memory of its comparison.
struct ReducedRegion {
  Eigen::VectorXf appearance;  ///< of unit energy
  Eigen::VectorXf centered;
  Eigen::VectorXf point;
};

/// The objects' own eigenspaces and the searches over their manifolds. Immutable once made; const calls are
/// thread-safe, and allocate nothing once a region has its memory.
class ObjectEigenspaceIndex {
 public:
  /// @param model outlives this.
  explicit ObjectEigenspaceIndex(const Model& model);

  /// @param appearance of the model's size, of any energy.
  void reduce(std::span<const float> appearance, ReducedRegion& region) const;

  /// Whether object `o` was learned with a space of its own.
  [[nodiscard]] bool has(std::size_t o) const { return searches_[o] != nullptr; }

  /// The closest point on object `o`'s own manifold. Its distance is between whole reduced pictures of unit
  /// energy: inside and outside of the eigenspace together, so that objects can be compared. @pre has(o), and
  /// `region` was reduced.
  ClosestPoint closest(std::size_t o, ReducedRegion& region) const;

 private:
  const Model& model_;
  std::vector<Manifold> manifolds_;  ///< of the objects that have one, in their order
  std::vector<std::unique_ptr<ManifoldSearch>> searches_;
  Eigen::Index most_components_ = 0;
};

}  // namespace eigenpose
