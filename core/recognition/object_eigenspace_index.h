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

/// Looks at one region after the other. Holds scratch memory: one thread at a time; allocates nothing after
/// construction.
class ObjectEigenspaceIndex {
 public:
  /// @param model outlives this.
  explicit ObjectEigenspaceIndex(const Model& model);

  /// Takes a new region: an appearance of the model's size, of any energy.
  void look(std::span<const float> appearance);

  /// Whether object `o` was learned with a space of its own.
  [[nodiscard]] bool has(std::size_t o) const { return searches_[o] != nullptr; }

  /// The closest point on object `o`'s own manifold. Its distance is between whole reduced pictures of unit
  /// energy: inside and outside of the eigenspace together, so that objects can be compared. @pre has(o) and
  /// a region was taken.
  ClosestPoint closest(std::size_t o);

 private:
  const Model& model_;
  std::vector<Manifold> manifolds_;  ///< of the objects that have one, in their order
  std::vector<std::unique_ptr<ManifoldSearch>> searches_;
  Eigen::VectorXf reduced_;  ///< of unit energy
  Eigen::VectorXf centered_;
  Eigen::VectorXf point_;
};

}  // namespace eigenpose
