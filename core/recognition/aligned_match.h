#pragma once

/// The whole region matched with its misalignment undone (alignment inside the match).
///
/// The alignment eigenspace of one object gives the misalignment of the region with respect to the learned
/// views. With that undone, the region is projected again, and its distance to the manifolds in the universal
/// eigenspace decides: it separates the learned objects, and known objects from unknown ones, best.
///
/// Where pictures have colours, the region's tint is undone with the misalignment: light and white balance
/// change by a few percent, which is more than new views of a densely sampled object differ by. With g(b, r)
/// the projection of the region with gains 1 + b of blue and 1 + r of red, m the nearest point of the
/// object's manifold, T the derivatives of g, s the distance of new views and e the effective dimensions, the
/// tint is x = (b, r), each held to ±10 %, of
///
///     (TᵀT + s²/(e·σ²)·I) x = Tᵀ(m − g(0, 0)),    σ = 0.03.
///
/// While s is being measured it counts as 0.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/alignment/alignment.h"
#include "core/image/appearance_maker.h"
#include "core/model/model.h"
#include "core/recognition/model_searches.h"
#include "core/search/search.h"

namespace eigenpose {

/// Distances of a realigned region in the universal eigenspace.
struct RealignedDistance {
  double own = 0.0;                   ///< to the manifold of the object it was aligned with
  std::optional<ClosestPoint> other;  ///< the nearest of the others within reach of the search
};

/// The object that a region is compared with.
struct ComparedObject {
  std::size_t object = 0;
  std::optional<std::size_t> absent = std::nullopt;  ///< another that counts as not learned
};

/// Distances of a point to `object` and to the nearest of the others but `absent`, which are looked for
/// within `reach`.
RealignedDistance distance_to(const Eigen::Ref<const Eigen::VectorXf>& point, const ModelSearches& searches,
                              const ComparedObject& object, double reach);

/// What becomes of a region's tint. Undoing it costs two more projections.
enum class Tint { kept, undone };

/// Aligns one region after the other. Holds scratch memory: one thread at a time.
class AlignedMatch {
 public:
  /// @param model has parts. @param searches of it; both outlive this. @param reach other objects farther
  /// than this are not looked for.
  AlignedMatch(const Model& model, const ModelSearches& searches, double reach);

  /// Poses of one object that fit, best first. Valid until the next call.
  const std::vector<AlignedPose>& align(const PosePicture& picture, std::size_t object) {
    return aligner_.align(picture, model_.parts->poses[object]);
  }

  /// @param picture as the normaliser makes it. @param misalignment of `object` in it.
  RealignedDistance distance(std::span<const float> picture, const Misalignment& misalignment,
                             const ComparedObject& object, Tint tint = Tint::undone);

  /// The realigned region in the universal eigenspace, as `distance` saw it last.
  [[nodiscard]] const Eigen::VectorXf& point() const { return point_; }

 private:
  /// Projects the realigned picture as it is, and with 3 columns with a step of each gain too.
  void project(Eigen::Index columns);
  /// Moves the point to what the region would be without its tint beside `object`.
  void undo_tint(std::size_t object);

  const Model& model_;
  const ModelSearches& searches_;
  double reach_;
  PoseAligner aligner_;
  AppearanceMaker maker_;
  std::vector<float> realigned_;  ///< picture
  std::vector<float> tinted_;     ///< the same with one gain moved
  Eigen::MatrixXf appearances_;   ///< of the picture; where it has colours, with a step of blue and of red
  Eigen::MatrixXf points_;        ///< of the appearances
  Eigen::VectorXd nearest_;       ///< point of the manifold
  Eigen::VectorXf point_;
};

}  // namespace eigenpose
