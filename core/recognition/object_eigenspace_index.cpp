#include "core/recognition/object_eigenspace_index.h"

#include <algorithm>
#include <cmath>

#include "core/simd/projection.h"

namespace eigenpose {

ObjectEigenspaceIndex::ObjectEigenspaceIndex(const Model& model)
    : model_(model), searches_(model.objects.size()) {
  manifolds_.reserve(model.objects.size());  // searches point into it
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const auto& space = model.objects[o].space;
    if (!space) continue;
    manifolds_.push_back(space->manifold);
    searches_[o] = make_search("tree", {&manifolds_.back(), 1});
    most_components_ = std::max(most_components_, space->eigenspace.components());
  }
}

void ObjectEigenspaceIndex::reduce(std::span<const float> appearance, ReducedRegion& region) const {
  const NormalizationOptions& options = model_.normalization;
  const int side = reduced_side(options);
  const int bands = appearance_bands(options);
  region.appearance.resize(Eigen::Index{side} * side * bands);
  region.centered.resize(region.appearance.size());
  region.point.resize(most_components_);
  shrink_appearance(appearance, options.size, bands, side,
                    {region.appearance.data(), static_cast<std::size_t>(region.appearance.size())});
  region.appearance.normalize();
}

ClosestPoint ObjectEigenspaceIndex::closest(std::size_t o, ReducedRegion& region) const {
  const Eigenspace& space = model_.objects[o].space->eigenspace;
  region.centered = region.appearance - space.mean;
  auto point = region.point.head(space.components());
  project_onto(space.basis, region.centered, point);
  ClosestPoint found;
  (void)searches_[o]->nearest_into(point, {&found, 1});
  const double outside =
      std::max(0.0, static_cast<double>(region.centered.squaredNorm()) - point.squaredNorm());
  found.distance = std::sqrt(found.distance * found.distance + outside);
  found.manifold = o;
  return found;
}

}  // namespace eigenpose
