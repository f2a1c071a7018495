#pragma once

/// A learned view, perturbed and compared as a region of a frame would be.

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "core/image/appearance_maker.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"
#include "core/recognition/aligned_match.h"
#include "core/recognition/model_searches.h"

namespace eigenpose {

/// Shows one picture after the other. Holds scratch memory: one thread at a time.
class ShownView {
 public:
  /// Both outlive it.
  ShownView(const Model& model, const ModelSearches& searches);

  /// Takes a normalised picture, 8 or 16 bits, displaced already.
  void show(const cv::Mat& picture);
  [[nodiscard]] std::span<const float> numbers() const { return numbers_; }
  /// The projection, without alignment.
  [[nodiscard]] const Eigen::VectorXf& point() const { return point_; }
  /// The nearest object but `absent`, without alignment. Nothing where there is no other.
  [[nodiscard]] std::optional<std::size_t> nearest(std::optional<std::size_t> absent) const;
  /// Distances to `object` and to the nearest other but `absent`; after alignment where the model has parts.
  RealignedDistance distance(std::size_t object, std::optional<std::size_t> absent);
  /// The projection that `distance` used last.
  [[nodiscard]] const Eigen::VectorXf& compared_point() const {
    return aligned_ ? aligned_->point() : point_;
  }
  [[nodiscard]] AlignedMatch& aligned_match() { return *aligned_; }

 private:
  const Model& model_;
  const ModelSearches& searches_;
  AppearanceMaker maker_;
  std::optional<AlignedMatch> aligned_;
  std::vector<float> numbers_;
  PosePicture pose_;
  Eigen::VectorXf appearance_;
  Eigen::VectorXf point_;
};

}  // namespace eigenpose
