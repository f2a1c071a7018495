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
  /// The nearest object but `absent`, without alignment. Nothing where there is no other.
  [[nodiscard]] std::optional<std::size_t> nearest(std::optional<std::size_t> absent);
  /// Distances to `object` and to the nearest other but `absent`; after alignment where the model has parts.
  RealignedDistance distance(std::size_t object, std::optional<std::size_t> absent);
  /// The misalignment that `distance` found last. @pre the model has parts.
  [[nodiscard]] const Misalignment& misalignment() const { return misalignment_; }
  /// Distances with a misalignment with respect to `object` that is known already. @pre the model has parts.
  RealignedDistance distance_at(const Misalignment& misalignment, std::size_t object);
  /// The projection that the last distance was measured from.
  [[nodiscard]] const Eigen::VectorXf& compared_point() const {
    return aligned_ ? aligned_->point() : point_;
  }
  [[nodiscard]] AlignedMatch& aligned_match() { return *aligned_; }

 private:
  /// The projection, without alignment.
  const Eigen::VectorXf& point();

  const Model& model_;
  const ModelSearches& searches_;
  AppearanceMaker maker_;
  std::optional<AlignedMatch> aligned_;
  std::vector<float> numbers_;
  cv::Mat picture_;
  PosePicture pose_;
  bool projected_ = false;  ///< point_ is that of picture_
  bool posed_ = false;      ///< pose_ likewise
  Misalignment misalignment_;
  Eigen::VectorXf appearance_;
  Eigen::VectorXf point_;
};

}  // namespace eigenpose
