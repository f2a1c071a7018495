#include "core/recognition/aligned_match.h"

#include <algorithm>
#include <array>

#include "core/alignment/misalignment.h"
#include "core/simd/projection.h"

namespace eigenpose {
namespace {

constexpr std::size_t blue = 0;  // bands of a picture with colours
constexpr std::size_t red = 2;
constexpr float tint_step = 0.02F;
constexpr double expected_tint = 0.03;  // 1 σ
constexpr float most_tint = 0.1F;
constexpr float least_slope = 1e-3F;  // a band with less has no colour to be tinted

}  // namespace

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
      realigned_(picture_length(model.normalization)),
      tinted_(realigned_.size()),
      appearances_(model.eigenspace.length(), picture_bands(model.normalization) == 3 ? 3 : 1),
      points_(model.eigenspace.components(), appearances_.cols()),
      nearest_(model.eigenspace.components()),
      point_(model.eigenspace.components()) {}

void AlignedMatch::project(Eigen::Index columns) {
  const auto make = [this](std::span<const float> picture, Eigen::Index column) {
    const std::span<float> appearance(appearances_.col(column).data(),
                                      static_cast<std::size_t>(appearances_.rows()));
    if (!maker_.is_picture()) return maker_.make(picture, appearance);
    std::ranges::copy(picture, appearance.begin());
    return appearances_.col(column).norm();
  };
  std::array<float, 3> energies{make(realigned_, 0)};
  for (Eigen::Index column = 1; column < columns; ++column) {
    tinted_ = realigned_;
    for (std::size_t i = column == 1 ? blue : red; i < tinted_.size(); i += 3) tinted_[i] *= 1.0F + tint_step;
    energies[static_cast<std::size_t>(column)] = make(tinted_, column);
  }
  project_onto(model_.eigenspace.basis, appearances_, columns, points_);
  for (Eigen::Index column = 0; column < columns; ++column)
    points_.col(column) /= std::max(energies[static_cast<std::size_t>(column)], 1e-9F);
  point_ = points_.col(0) - searches_.mean_point;
}

void AlignedMatch::undo_tint(std::size_t object) {
  std::array<ClosestPoint, 1> own;
  (void)searches_.separate[object].nearest_into(point_, own);
  const Manifold& manifold = searches_.manifolds[object];
  manifold.evaluate_into(std::span(own[0].q).first(manifold.axes().size()), nearest_);
  auto slopes = points_.rightCols<2>();
  for (Eigen::Index column = 0; column < 2; ++column)
    slopes.col(column) = (slopes.col(column) - points_.col(0)) / tint_step;
  Eigen::Matrix2f normal = slopes.transpose().lazyProduct(slopes);
  const double typical = model_.objects[object].typical_distance;
  const double variance = typical * typical / model_.decision.tuning.effective_dimensions;
  normal.diagonal().array() +=
      least_slope * least_slope + static_cast<float>(variance / (expected_tint * expected_tint));
  const float determinant = normal(0, 0) * normal(1, 1) - normal(0, 1) * normal(1, 0);
  const Eigen::Vector2f pull = slopes.transpose().lazyProduct(nearest_.cast<float>() - point_);
  Eigen::Vector2f gains((normal(1, 1) * pull[0] - normal(0, 1) * pull[1]) / determinant,
                        (normal(0, 0) * pull[1] - normal(1, 0) * pull[0]) / determinant);
  gains = gains.cwiseMax(-most_tint).cwiseMin(most_tint);
  point_ += slopes.col(0) * gains[0] + slopes.col(1) * gains[1];
}

RealignedDistance AlignedMatch::distance(std::span<const float> picture, const Misalignment& misalignment,
                                         const ComparedObject& object, Tint tint) {
  (void)undo_misalignment(picture, model_.normalization.size, picture_bands(model_.normalization),
                          misalignment, realigned_);
  const Eigen::Index columns = tint == Tint::undone ? appearances_.cols() : 1;
  project(columns);
  if (columns == 3) undo_tint(object.object);
  return distance_to(point_, searches_, object, reach_);
}

}  // namespace eigenpose
