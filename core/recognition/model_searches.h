#pragma once

/// The searches over a model's manifolds: made once, immutable, shared by all threads.

#include <memory>
#include <string_view>
#include <vector>

#include "core/model/model.h"
#include "core/recognition/aligned_match.h"
#include "core/search/search.h"

namespace eigenpose {

struct ModelSearches {
  /// @param kind of the search over all manifolds: see make_search.
  explicit ModelSearches(const Model& model, std::string_view kind = "tree");

  std::vector<Manifold> manifolds;  ///< of the objects, in their order
  std::unique_ptr<ManifoldSearch> all;
  SeparateSearches separate;
};

}  // namespace eigenpose
