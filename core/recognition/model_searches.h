#pragma once

/// The searches over a model's manifolds: made once, immutable, shared by all threads.

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/model/model.h"
#include "core/search/search.h"

namespace eigenpose {

/// One search for each manifold alone. Immutable once made; const calls are thread-safe: make it once, share
/// it.
class SeparateSearches {
 public:
  /// @param manifolds are kept by reference: they outlive the searches.
  explicit SeparateSearches(std::span<const Manifold> manifolds);

  [[nodiscard]] const ManifoldSearch& operator[](std::size_t manifold) const { return *searches_[manifold]; }

 private:
  std::vector<std::unique_ptr<ManifoldSearch>> searches_;
};

struct ModelSearches {
  /// @param kind of the search over all manifolds: see make_search.
  explicit ModelSearches(const Model& model, std::string_view kind = "tree");

  std::vector<Manifold> manifolds;  ///< of the objects, in their order
  std::unique_ptr<ManifoldSearch> all;
  SeparateSearches separate;
  Eigen::VectorXf mean_point;  ///< of the universal eigenspace: basisᵀ mean
};

}  // namespace eigenpose
