#include "core/recognition/aligned_match.h"

#include <algorithm>
#include <array>

#include "core/alignment/misalignment.h"
#include "core/simd/projection.h"

namespace eigenpose {

RealignedDistance distance_to(const Eigen::Ref<const Eigen::VectorXf>& point, const ModelSearches& searches,
                              const ComparedObject& object, double reach) {
  RealignedDistance result;
  std::array<ClosestPoint, 3> near;
  // The object itself and the absent one may stand before the nearest other.
  const std::size_t wanted = object.absent ? 3 : 2;
  const std::size_t count = searches.all->nearest_into(point, std::span(near).first(wanted), reach);
  bool seen = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (near[i].manifold == object.object) {
      result.own = near[i].distance;
      seen = true;
    } else if (!result.other && near[i].manifold != object.absent) {
      result.other = near[i];
    }
  }
  if (!seen) {
    std::array<ClosestPoint, 1> own;
    (void)searches.separate[object.object].nearest_into(point, own);
    result.own = own[0].distance;
  }
  return result;
}

AlignedMatch::AlignedMatch(const Model& model, const ModelSearches& searches, double reach)
    : model_(model),
      searches_(searches),
      reach_(reach),
      aligner_([&] {
        AlignmentOptions options;
        options.noise = model.parts->noise;
        return options;
      }()),
      maker_(model.normalization),
      realigned_(maker_.is_picture() ? 0 : picture_length(model.normalization)),
      appearance_(model.eigenspace.length()),
      point_(model.eigenspace.components()) {}

RealignedDistance AlignedMatch::distance(std::span<const float> picture, const Misalignment& misalignment,
                                         const ComparedObject& object) {
  const std::span<float> appearance(appearance_.data(), static_cast<std::size_t>(appearance_.size()));
  const bool typed = !maker_.is_picture();
  float energy = undo_misalignment(picture, model_.normalization.size, picture_bands(model_.normalization),
                                   misalignment, typed ? std::span<float>(realigned_) : appearance);
  if (typed) energy = maker_.make(realigned_, appearance);
  project_onto(model_.eigenspace.basis, appearance_, point_);
  point_ /= std::max(energy, 1e-9F);
  point_ -= searches_.mean_point;
  return distance_to(point_, searches_, object, reach_);
}

}  // namespace eigenpose
