#include "core/learning/calibration/shown_view.h"

#include <algorithm>
#include <array>
#include <limits>

#include "core/simd/projection.h"

namespace eigenpose {

ShownView::ShownView(const Model& model, const ModelSearches& searches)
    : model_(model),
      searches_(searches),
      maker_(model.normalization),
      numbers_(picture_length(model.normalization)),
      appearance_(model.eigenspace.length()),
      point_(model.eigenspace.components()) {
  if (model.parts) aligned_.emplace(model, searches, std::numeric_limits<double>::infinity());
}

void ShownView::show(const cv::Mat& picture) {
  picture_ = picture;
  picture_numbers(picture, numbers_);
  projected_ = posed_ = false;
}

const Eigen::VectorXf& ShownView::point() {
  if (projected_) return point_;
  const float energy =
      maker_.make(numbers_, {appearance_.data(), static_cast<std::size_t>(appearance_.size())});
  project_onto(model_.eigenspace.basis, appearance_, point_);
  point_ = point_ / std::max(energy, 1e-9F) - searches_.mean_point;
  projected_ = true;
  return point_;
}

std::optional<std::size_t> ShownView::nearest(std::optional<std::size_t> absent) {
  std::array<ClosestPoint, 2> near;
  const std::size_t count = searches_.all->nearest_into(point(), near);
  for (std::size_t i = 0; i < count; ++i)
    if (near[i].manifold != absent) return near[i].manifold;
  return std::nullopt;
}

RealignedDistance ShownView::distance(std::size_t object, std::optional<std::size_t> absent) {
  if (aligned_) {
    if (!posed_) make_pose_picture(picture_, pose_);
    posed_ = true;
    misalignment_ = aligned_->align(pose_, object).front().misalignment;
    return aligned_->distance(numbers_, misalignment_, {object, absent});
  }
  return distance_to(point(), searches_, {object, absent}, std::numeric_limits<double>::infinity());
}

RealignedDistance ShownView::distance_at(const Misalignment& misalignment, std::size_t object) {
  return aligned_->distance(numbers_, misalignment, {object, std::nullopt});
}

}  // namespace eigenpose
