#pragma once

/// The alignment eigenspace: eigenspace and manifold of one object's brightness, for finding pose and
/// misalignment of a known object.
///
/// Appearances are grey, of unit energy and blurred, at two scales. All dimensions that the views span are
/// kept, so that a point of the manifold is the interpolated view itself.

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "core/alignment/misalignment.h"
#include "core/base/grid.h"
#include "core/manifold/manifold.h"
#include "core/manifold/sample_grid.h"

namespace eigenpose {

/// A grey picture ready for alignment, and how it changes from pixel to pixel.
struct PosePicture {
  static constexpr int side = 64;
  /// 64×64 texels of 4 floats: brightness 0…1, its central differences after x and y, and 0.
  std::vector<float> blurred;  ///< Gaussian σ = 1.5 px: for the coarse scale
  std::vector<float> sharp;    ///< for the fine scale
};

/// Makes `out` from a square CV_8UC1 or CV_8UC3 picture of any size.
void make_pose_picture(const cv::Mat& picture, PosePicture& out);

/// One scale of an alignment eigenspace.
struct PoseScale {
  int side = 0;           ///< pixels a side: 32 (coarse) or 48 (fine)
  Eigen::MatrixXf basis;  ///< side² × D
  Eigen::VectorXf mean;   ///< basisᵀ · mean picture, D

  /// Samples `picture` with a misalignment undone, to unit energy, together with its derivatives after each
  /// unknown.
  /// @param out side² × 6: the picture, then its derivatives after gain, dx, dy, scale and rotation.
  void warp(const PosePicture& picture, const Misalignment& misalignment, bool derivatives,
            Eigen::MatrixXf& out) const;
};

/// What is learned of one object's pose. Value type; const calls are thread-safe.
class AlignmentEigenspace {
 public:
  AlignmentEigenspace() = default;
  /// @param axes the grid of the views; @param views in the order of Manifold::interpolate (last axis
  /// fastest).
  /// @throws std::invalid_argument for fewer than two views or sizes that do not fit.
  /// @param poses of the views, m × n, where they are no grid (see Manifold::fit).
  static AlignmentEigenspace learn(const std::vector<SampleAxis>& axes, const std::vector<PosePicture>& views,
                                   const Eigen::MatrixXd& poses = {});

  /// Rebuilds what a model file stores. @throws std::invalid_argument for sizes that do not fit.
  static AlignmentEigenspace from_parts(PoseScale coarse, PoseScale fine, Eigen::VectorXf pixel_mean,
                                        Manifold coarse_manifold, Manifold fine_manifold);

  [[nodiscard]] const PoseScale& coarse() const { return coarse_; }
  /// Mean picture of the coarse scale, 32² pixels.
  [[nodiscard]] const Eigen::VectorXf& pixel_mean() const { return pixel_mean_; }
  /// The object's picture of unit energy at a pose: `out` gets 32² pixels of the coarse scale, row by row.
  void render(std::span<const double> q, Eigen::VectorXf& out) const;
  [[nodiscard]] const PoseScale& fine() const { return fine_; }
  [[nodiscard]] const Manifold& coarse_manifold() const { return *coarse_manifold_; }
  [[nodiscard]] const Manifold& fine_manifold() const { return *fine_manifold_; }
  /// Grid of manifold samples: poses (m × T) and coarse points (D × T), last DOF fastest.
  [[nodiscard]] const Eigen::MatrixXd& sample_poses() const { return sample_poses_; }
  [[nodiscard]] const Eigen::MatrixXf& samples() const { return samples_; }
  [[nodiscard]] const float* sample(std::size_t t) const {
    return samples_.col(static_cast<Eigen::Index>(t)).data();
  }
  [[nodiscard]] const Grid& sample_grid() const { return sample_grid_; }
  /// Whether the samples along a DOF close on themselves.
  [[nodiscard]] Grid::Ends ends(std::size_t dof) const { return ends_of(coarse_manifold_->axes()[dof]); }
  /// Squared error of the spline at each learned view when that view is left out (coarse scale). A model file
  /// does not keep them.
  [[nodiscard]] const std::vector<double>& left_out_errors() const { return left_out_errors_; }
  /// The same eigenspace with the errors that were measured when it was learned.
  [[nodiscard]] AlignmentEigenspace with_left_out_errors(std::vector<double> errors) const;
  [[nodiscard]] std::size_t memory() const;

 private:
  void make_samples();

  PoseScale coarse_;
  PoseScale fine_;
  Eigen::VectorXf pixel_mean_;
  std::optional<Manifold> coarse_manifold_;  ///< always set once learned
  std::optional<Manifold> fine_manifold_;
  Eigen::MatrixXd sample_poses_;
  Eigen::MatrixXf samples_;
  Grid sample_grid_;
  std::vector<double> left_out_errors_;
};

}  // namespace eigenpose
