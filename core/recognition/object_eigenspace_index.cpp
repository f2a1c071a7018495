#include "core/recognition/object_eigenspace_index.h"

#include <algorithm>
#include <cmath>

#include "core/simd/projection.h"

namespace eigenpose {

ObjectEigenspaceIndex::ObjectEigenspaceIndex(const Model& model)
    : model_(model), searches_(model.objects.size()) {
  manifolds_.reserve(model.objects.size());  // searches point into it
  const auto side = static_cast<Eigen::Index>(reduced_side(model.normalization));
  reduced_.resize(side * side * appearance_bands(model.normalization));
  centered_.resize(reduced_.size());
  Eigen::Index largest = 0;
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const auto& space = model.objects[o].space;
    if (!space) continue;
    manifolds_.push_back(space->manifold);
    searches_[o] = make_search("tree", {&manifolds_.back(), 1});
    largest = std::max(largest, space->eigenspace.components());
  }
  point_.resize(largest);
}

void ObjectEigenspaceIndex::look(std::span<const float> appearance) {
  const NormalizationOptions& options = model_.normalization;
  shrink_appearance(appearance, options.size, appearance_bands(options), reduced_side(options),
                    {reduced_.data(), static_cast<std::size_t>(reduced_.size())});
  reduced_.normalize();
}

ClosestPoint ObjectEigenspaceIndex::closest(std::size_t o) {
  const Eigenspace& space = model_.objects[o].space->eigenspace;
  centered_ = reduced_ - space.mean;
  auto point = point_.head(space.components());
  project_onto(space.basis, centered_, point);
  ClosestPoint found;
  (void)searches_[o]->nearest_into(point, {&found, 1});
  const double outside = std::max(0.0, static_cast<double>(centered_.squaredNorm()) - point.squaredNorm());
  found.distance = std::sqrt(found.distance * found.distance + outside);
  found.manifold = o;
  return found;
}

}  // namespace eigenpose
