#pragma once

/// What recognition makes of a model once: searches over its manifolds, and samples of them.

#include <memory>
#include <string>
#include <vector>

#include "core/model/model.h"
#include "core/recognition/manifold_samples.h"
#include "core/recognition/model_searches.h"
#include "core/recognition/object_eigenspace_index.h"
#include "core/recognition/view_extents.h"
#include "core/search/search.h"

namespace eigenpose {

/// How a recogniser finds the nearest manifold. Every choice but "rbf" gives the same answers.
struct RecognizerOptions {
  /// "tree", "flann", "slab", or "rbf": networks in place of a search, approximate.
  std::string search = "tree";
  /// First exclude the manifolds that are certainly too far, by a composite rejector.
  bool rejector = false;
};

/// Immutable once made; const calls are thread-safe. Make one of a model, and share it between recognisers.
class RecognitionIndex {
 public:
  /// @throws std::invalid_argument for an unknown search, or a model without objects.
  explicit RecognitionIndex(std::shared_ptr<const Model> model, const RecognizerOptions& options = {});

  [[nodiscard]] const Model& model() const { return *model_; }
  [[nodiscard]] const ModelSearches& searches() const { return searches_; }
  /// Finds the manifolds within `reach` of a point: the rejector before the search, where there is one.
  [[nodiscard]] const ManifoldSearch& within_reach() const { return rejector_ ? *rejector_ : *searches_.all; }
  /// No farther manifold can be accepted, nor be the runner-up of an accepted one.
  [[nodiscard]] double reach() const { return reach_; }
  [[nodiscard]] const ObjectEigenspaceIndex& object_eigenspaces() const { return object_eigenspaces_; }
  /// Of the manifold of object `o`. @pre the model has no parts: only then are they made.
  [[nodiscard]] const ManifoldSamples& samples(std::size_t o) const { return samples_[o]; }
  [[nodiscard]] const ViewExtents& extents() const { return extents_; }

 private:
  std::shared_ptr<const Model> model_;
  ModelSearches searches_;
  double reach_ = 0.0;
  std::unique_ptr<ManifoldSearch> rejector_;
  ObjectEigenspaceIndex object_eigenspaces_;
  std::vector<ManifoldSamples> samples_;
  ViewExtents extents_;
};

}  // namespace eigenpose
