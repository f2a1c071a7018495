#pragma once

/// The closest point on many manifolds, behind one interface.

#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose {

/// The closest point on one manifold.
struct Closest {
  std::size_t manifold = 0;  ///< index into the searched list
  std::vector<double> q;     ///< m values, canonical
  double distance = 0.0;     ///< Euclidean, to the *continuous* manifold
};

/// The same without memory of its own, for the path that runs every frame.
struct ClosestPoint {
  std::size_t manifold = 0;
  std::array<double, max_manifold_dofs> q{};  ///< the first m count, canonical
  double distance = 0.0;
};

/// Nearest-manifold search. Built once over a list of manifolds of equal K (m may differ); const calls are
/// thread-safe. Every implementation but "rbf" is exact: its distance is that of an exhaustive search up to
/// 1e-5. Among equally near manifolds the one that stands first in the list wins.
class ManifoldSearch {
 public:
  virtual ~ManifoldSearch() = default;

  /// The closest points on up to `count` *different* manifolds, nearest first, leaving out those farther than
  /// `bound`. Empty when none lies within it.
  /// @throws std::invalid_argument when point.size() ≠ K.
  [[nodiscard]] virtual std::vector<Closest> nearest(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::size_t count = 1,
      double bound = std::numeric_limits<double>::infinity()) const;

  /// The same into memory of the caller, at most `results.size()` of them; returns how many. The tree
  /// allocates nothing here after the first query of a thread.
  [[nodiscard]] virtual std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const = 0;

  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Bytes held beside the manifolds themselves.
  [[nodiscard]] virtual std::size_t memory() const = 0;
  /// The list that was given.
  [[nodiscard]] std::span<const Manifold> manifolds() const { return manifolds_; }

 protected:
  explicit ManifoldSearch(std::span<const Manifold> manifolds) : manifolds_(manifolds) {}
  ManifoldSearch(const ManifoldSearch&) = default;
  ManifoldSearch& operator=(const ManifoldSearch&) = default;

 private:
  std::span<const Manifold> manifolds_;
};

/// @param kind "tree" (default: exact box tree over the spline segments), "flann" (exact single kd-tree over
/// samples, then refinement), "slab" (Nene–Nayar), "rbf" (networks: approximate).
/// @param manifolds are kept by reference: they outlive the search.
/// @throws std::invalid_argument for an unknown kind, an empty list or unequal K.
std::unique_ptr<ManifoldSearch> make_search(std::string_view kind, std::span<const Manifold> manifolds);

/// The default search: the tree.
std::unique_ptr<ManifoldSearch> make_search(std::span<const Manifold> manifolds);

}  // namespace eigenpose
