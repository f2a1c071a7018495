#pragma once

/// Pose and misalignment found together (eq. 8's manifold, moved by the tangents of imperfect segmentation).
///
/// For a region f, a manifold M(q) and the tangents J of shift, scale, rotation and gain, every sampled pose
/// has its best misalignment in closed form: (JᵀJ + νΛ)x = Jᵀ(M(q) − f) − νΛp, where Λ = diag 1/σ² is what is
/// likely and p what was undone before. The deepest minima over the pose are followed by Gauss–Newton rounds
/// that warp the region anew, then compared at the fine scale. ν, learned from the views, is the error
/// variance that the spline leaves.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/alignment/alignment_eigenspace.h"
#include "core/base/bounded_vector.h"

namespace eigenpose {

/// How large misalignments are expected to be (1 σ).
struct AlignmentPrior {
  double gain = 0.1;
  double shift = 2.0 / 128.0;  ///< share of the region's side
  double scale = 0.03;
  double rotation = 3.0 * 0.017453292519943295;  ///< radians

  [[nodiscard]] Eigen::Matrix<double, 5, 1> precision() const;
};

/// The most poses of one object that are followed.
inline constexpr std::size_t most_poses = 6;

struct AlignmentOptions {
  AlignmentPrior prior;
  double noise = 1e-4;              ///< ν, squared length between unit-energy appearances
  std::size_t starts = most_poses;  ///< minima over the pose that are followed
  double hopeless =
      60.0;        ///< minima higher than twice the deepest by more than this times ν are not followed
  int rounds = 6;  ///< Gauss–Newton rounds each
  double reach = 20.0 / 360;  ///< how far a round may move the pose, as a share of a periodic DOF's range
  bool fine = true;           ///< compare the ends at the fine scale
  double close = 40.0;  ///< ends higher than the deepest by more than this times ν are as bad there too
};

/// The numbers of a pose, and m × m of its covariance, row by row.
using PoseNumbers = BoundedVector<double, max_manifold_dofs>;
using PoseSquare = BoundedVector<double, max_manifold_dofs * max_manifold_dofs>;

/// One pose that fits a region.
struct AlignedPose {
  PoseNumbers q;
  Misalignment misalignment;
  double cost = 0.0;        ///< squared distance after alignment plus νpᵀΛp, coarse scale
  double fine_cost = 0.0;   ///< the same at the fine scale, where poses are compared there
  PoseSquare q_covariance;  ///< infinite where a DOF cannot be seen
};

/// Aligns regions with pose spaces. Holds scratch memory: one thread at a time.
class PoseAligner {
 public:
  explicit PoseAligner(AlignmentOptions options) : options_(options), precision_(options.prior.precision()) {}

  /// Poses of `space` that fit, best first, different from each other. Valid until the next call.
  const std::vector<AlignedPose>& align(const PosePicture& picture, const AlignmentEigenspace& space);

 private:
  void project(const AlignmentEigenspace& space, const PoseScale& scale, const PosePicture& picture,
               const Misalignment& p);
  /// The same picture again, moved a little more: J stays, as it hardly changes any more.
  void project_picture(const AlignmentEigenspace& space, const PosePicture& picture, const Misalignment& p);
  /// The normal equations of J.
  void prepare();
  void set_prior(const Misalignment& p);
  /// J, D × 5.
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXf> tangents() const {
    return {projected_.data() + dimensions_, dimensions_, Misalignment::unknowns};
  }
  /// Cost of one manifold point after its best misalignment, which goes to `x`.
  double cost_at(const float* point, Eigen::Matrix<double, 5, 1>* x) const;
  void follow(const PosePicture& picture, const AlignmentEigenspace& space, std::size_t start,
              AlignedPose& end);
  double fine_cost(const PosePicture& picture, const AlignmentEigenspace& space, const AlignedPose& pose);
  /// Where there are several DOFs, their covariance together, as the normal equations of the last round have
  /// it. @param variance of each number of a point.
  void relate(const AlignmentEigenspace& space, double variance, AlignedPose& pose) const;

  AlignmentOptions options_;
  Eigen::Matrix<double, 5, 1> precision_;
  Eigen::MatrixXf coarse_warped_;  ///< pixels × 6; J apart, that of the last projection with it
  Eigen::MatrixXf fine_warped_;
  Eigen::Index dimensions_ = 0;   ///< D
  std::vector<float> projected_;  ///< D × 6: f, then J
  std::vector<float> unmoved_;    ///< the same of the picture as it is, coarse scale
  Eigen::Matrix<double, 5, 5> unmoved_inverse_;
  Eigen::VectorXd fine_point_;
  std::vector<float> fine_numbers_;
  Eigen::Matrix<double, 5, 5> inverse_;
  Eigen::Matrix<double, 5, 1> prior_pull_;
  double prior_cost_ = 0.0;
  std::vector<double> costs_;
  std::vector<std::size_t> minima_;
  std::vector<AlignedPose> poses_;
};

}  // namespace eigenpose
