#pragma once

/// The whole region matched with its misalignment undone (alignment inside the match).
///
/// The pose space of one object says how the region lies beside the learned views. With that undone, the
/// region is projected anew, and its distance to the manifolds in the universal eigenspace is what decides:
/// there objects are told apart best, and strangers from known ones.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/alignment/alignment.h"
#include "core/image/appearance_maker.h"
#include "core/model/model.h"
#include "core/search/search.h"

namespace eigenpose {

/// Distances of a realigned region in the universal eigenspace.
struct RealignedDistance {
  double own = 0.0;                   ///< to the manifold of the object it was aligned with
  std::optional<ClosestPoint> other;  ///< the nearest of the others within reach of the search
};

/// Aligns one region after the other. Holds scratch memory: one thread at a time.
class AlignedMatch {
 public:
  /// @param model has parts; it and `search`, over its manifolds, outlive this. @param reach others that are
  /// farther are not looked for.
  AlignedMatch(const Model& model, const ManifoldSearch& search, double reach);

  /// Poses of one object that fit, best first. Valid until the next call.
  const std::vector<AlignedPose>& align(const PosePicture& picture, std::size_t object) {
    return aligner_.align(picture, model_.parts->poses[object]);
  }

  /// @param picture as the normaliser makes it. @param misalignment of `object` in it.
  RealignedDistance distance(std::span<const float> picture, const Misalignment& misalignment,
                             std::size_t object);

  /// The realigned region in the universal eigenspace, as `distance` saw it last.
  [[nodiscard]] const Eigen::VectorXf& point() const { return point_; }

 private:
  const Model& model_;
  const ManifoldSearch& search_;
  double reach_;
  std::vector<std::unique_ptr<ManifoldSearch>> own_;  ///< one an object
  PoseAligner aligner_;
  Eigen::VectorXf mean_point_;  ///< basisᵀ mean
  AppearanceMaker maker_;
  std::vector<float> realigned_;  ///< picture
  Eigen::VectorXf appearance_;
  Eigen::VectorXf point_;
};

}  // namespace eigenpose
