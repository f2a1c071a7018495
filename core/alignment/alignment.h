#pragma once

/// Pose and misalignment found together (eq. 8's manifold, moved by the tangents of imperfect segmentation).
///
/// For a region f, a manifold M(q) and the tangents J of gain, shift, scale and rotation, every sampled pose
/// has its best further misalignment x in closed form:
///
///     (JᵀJ + νΛ) x = Jᵀ(M(q) − f) − νΛp,
///
/// where p is the misalignment undone before, Λ = diag(1/σ²) the precision of the prior on p + x, and ν the
/// error variance that the spline leaves, learned from the views. The cost of a pose is
/// c(q) = ‖M(q) − f − Jx‖² + ν(p + x)ᵀΛ(p + x). The deepest minima of c over the sampled poses are followed
/// by Gauss–Newton rounds that warp the region again, then compared at the fine scale.

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
  double hopeless = 60.0;           ///< a start with cost c is followed only if c ≤ 2·c_min + hopeless·ν
  int rounds = 6;                   ///< Gauss–Newton rounds for each start
  double reach = 20.0 / 360;        ///< how far a round may move the pose, as a share of a DOF's samples
  bool fine = true;                 ///< compare the poses found at the fine scale
  double close = 40.0;              ///< only poses with cost c < c_min + close·ν are compared there
};

/// A pose: m values, and the m × m values of its covariance, row by row. Without memory of their own.
using PoseVector = BoundedVector<double, max_manifold_dofs>;
using PoseCovariance = BoundedVector<double, max_manifold_dofs * max_manifold_dofs>;

/// One pose that fits a region.
struct AlignedPose {
  PoseVector q;
  Misalignment misalignment;
  double cost = 0.0;            ///< c(q), coarse scale
  double fine_cost = 0.0;       ///< the same at the fine scale, where poses are compared there
  PoseCovariance q_covariance;  ///< infinite where a DOF is not observable
};

/// Aligns regions with alignment eigenspaces. Holds scratch memory: one thread at a time.
class PoseAligner {
 public:
  explicit PoseAligner(AlignmentOptions options) : options_(options), precision_(options.prior.precision()) {}

  /// Poses of `space` that fit, best first, different from each other. Valid until the next call.
  const std::vector<AlignedPose>& align(const PosePicture& picture, const AlignmentEigenspace& space);

 private:
  void project(const AlignmentEigenspace& space, const PoseScale& scale, const PosePicture& picture,
               const Misalignment& p);
  /// The picture warped again by a little more. J stays: its change is of second order.
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
  /// Local minima of costs_ over the grid of samples, into minima_.
  void find_minima(const AlignmentEigenspace& space);
  /// Warps and projects the picture for one round.
  void begin_round(const PosePicture& picture, const AlignmentEigenspace& space, int round,
                   const Misalignment& p);
  /// The sample of least cost within reach, by coordinate descent over the grid: exact for one DOF.
  /// @param lowest gets its cost.
  std::size_t best_within_reach(const AlignmentEigenspace& space, std::size_t here, double& lowest) const;
  AlignedPose follow(const PosePicture& picture, const AlignmentEigenspace& space, std::size_t start);
  /// Moves the pose between samples, by a parabola along each DOF, and sets its covariance.
  void interpolate(const AlignmentEigenspace& space, std::size_t sample, AlignedPose& pose) const;
  /// Sets the fine costs of poses_.
  void compare_fine(const PosePicture& picture, const AlignmentEigenspace& space);
  /// The least cost at the fine scale near a pose: the misalignment stays, each DOF moves by up to 5/360 of
  /// its range.
  double fine_cost(const PosePicture& picture, const AlignmentEigenspace& space, const AlignedPose& pose);
  /// The joint covariance of several DOFs, from the normal equations of the last round. @param variance of
  /// each coordinate of a point.
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
  std::vector<float> fine_coordinates_;
  Eigen::Matrix<double, 5, 5> inverse_;
  Eigen::Matrix<double, 5, 1> prior_pull_;
  double prior_cost_ = 0.0;
  std::vector<double> costs_;
  std::vector<std::size_t> minima_;
  std::vector<AlignedPose> poses_;
};

}  // namespace eigenpose
