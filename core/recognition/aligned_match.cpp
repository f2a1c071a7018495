#include "core/recognition/aligned_match.h"

#include <algorithm>
#include <array>

#include "core/alignment/misalignment.h"
#include "core/simd/projection.h"

namespace eigenpose {

SeparateSearches::SeparateSearches(std::span<const Manifold> manifolds) {
  searches_.reserve(manifolds.size());
  for (const Manifold& manifold : manifolds) searches_.push_back(make_search("tree", {&manifold, 1}));
}

AlignedMatch::AlignedMatch(const Model& model, const ManifoldSearch& all, const SeparateSearches& separate,
                           double reach)
    : model_(model),
      all_(all),
      separate_(separate),
      reach_(reach),
      aligner_([&] {
        AlignmentOptions options;
        options.noise = model.parts->noise;
        return options;
      }()),
      mean_point_(model.eigenspace.basis.transpose() * model.eigenspace.mean),
      maker_(model.normalization),
      realigned_(maker_.is_picture() ? 0 : picture_length(model.normalization)),
      appearance_(model.eigenspace.length()),
      point_(model.eigenspace.components()) {}

RealignedDistance AlignedMatch::distance(std::span<const float> picture, const Misalignment& misalignment,
                                         std::size_t object) {
  const std::span<float> appearance(appearance_.data(), static_cast<std::size_t>(appearance_.size()));
  const bool typed = !maker_.is_picture();
  float energy = undo_misalignment(picture, model_.normalization.size, picture_bands(model_.normalization),
                                   misalignment, typed ? std::span<float>(realigned_) : appearance);
  if (typed) energy = maker_.make(realigned_, appearance);
  project_onto(model_.eigenspace.basis, appearance_, point_);
  point_ /= std::max(energy, 1e-9F);
  point_ -= mean_point_;
  RealignedDistance result;
  std::array<ClosestPoint, 2> near;
  const std::size_t count = all_.nearest_into(point_, near, reach_);
  bool seen = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (near[i].manifold == object) {
      result.own = near[i].distance;
      seen = true;
    } else if (!result.other) {
      result.other = near[i];
    }
  }
  if (!seen) {
    std::array<ClosestPoint, 1> own;
    (void)separate_[object].nearest_into(point_, own);
    result.own = own[0].distance;
  }
  return result;
}

}  // namespace eigenpose
