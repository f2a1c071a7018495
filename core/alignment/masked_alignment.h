#pragma once

/// Alignment on the visible pixels, for partly occluded objects (gappy projection of Everson and Sirovich,
/// with robust weights).
///
/// An occluder changes the energy of a region, and all its projections. Here the manifold's point is compared
/// with the region pixel by pixel, with gain and misalignment as free unknowns:
///
///     c(q) = Σᵢ wᵢ (Mᵢ(q) − fᵢ − (Jx)ᵢ)² + ν(p + x)ᵀΛ(p + x).
///
/// In the first rounds wᵢ is the trust of the windows around pixel i; in the later ones the weight of Geman
/// and McClure of its residual r, (1 + r²/(3σ)²)⁻², so that the occluder's outline is found to the pixel.

#include <span>
#include <vector>

#include "core/alignment/alignment.h"

namespace eigenpose {

/// A pose of a partly occluded object.
struct MaskedPose {
  AlignedPose aligned;      ///< its cost is over the visible pixels
  double first_gain = 0.0;  ///< ratio of the object's to the trusted pixels' brightness at the start, minus 1
  /// Σᵢ min(rᵢ²/2σ², ½·3²) over all pixels, σ² a pixel's noise: an occluded pixel counts as one that is 3 σ
  /// off, so that an occluder costs every pose the same.
  double unexplained = 0.0;
};

/// Aligns one occluded region after the other. Holds scratch memory: one thread at a time.
class MaskedAligner {
 public:
  explicit MaskedAligner(const AlignmentOptions& options);

  /// Sets the region and the object for `approach` and `refine`. All three must stay until their last call.
  /// @param trust 32×32 weights 0…1, row by row.
  void look(const PosePicture& picture, const AlignmentEigenspace& space, std::span<const float> trust);
  /// The first rounds from a pose, weighted by trust. Cheap beside `refine`. @throws std::logic_error before
  /// `look`.
  /// @param reach how far a round may move the pose, as a share of each DOF's range.
  MaskedPose approach(std::span<const double> start, double reach);
  /// The later rounds, weighted by residual. @throws std::logic_error before `look`.
  /// @param reach as given to `approach`.
  void refine(MaskedPose& pose, double reach);

 private:
  using Vector5 = Eigen::Matrix<double, 5, 1>;

  /// Gain that makes the trusted pixels agree with the picture rendered last, minus 1.
  [[nodiscard]] double first_gain() const;
  /// Weights from what the rendered picture leaves unexplained of the warped region.
  void weigh_by_residual();
  /// BᵀWB of the weights.
  void weigh_basis();
  /// The normal equations of the weighted difference, for any pose: see cost_at.
  void prepare(const Misalignment& misalignment, double first_gain);
  /// Cost at a pose after its best further misalignment, which goes to `x`.
  double cost_at(std::span<const double> q, Vector5* x);
  /// Where there are several DOFs, their covariance together.
  void relate(AlignedPose& pose) const;
  /// Moves a pose to the lowest cost along each DOF, then undoes its further misalignment.
  /// @param step_share of each DOF's range, between the poses that are looked at.
  void move(MaskedPose& pose, double step_share);

  AlignmentOptions options_;
  Vector5 precision_;
  const PosePicture* picture_ = nullptr;
  const AlignmentEigenspace* space_ = nullptr;
  std::span<const float> trust_;
  double pixel_variance_ = 0.0;

  Eigen::MatrixXf warped_;    ///< pixels × 6: f, then its tangents
  Eigen::VectorXf rendered_;  ///< pixels
  Eigen::VectorXf weights_;   ///< pixels
  std::vector<float> residuals_;
  Eigen::MatrixXf weighted_;           ///< pixels × 6: W(mean − f), then WJ
  Eigen::MatrixXf weighted_basis_;     ///< pixels × D
  Eigen::MatrixXf quadratic_;          ///< BᵀWB, D × D, its lower half
  Eigen::MatrixXf trusted_quadratic_;  ///< the same of the trust
  bool trusted_quadratic_known_ = false;
  Eigen::MatrixXf linear_;     ///< D × 6: Bᵀ weighted_
  Eigen::VectorXf product_;    ///< D
  double constant_ = 0.0;      ///< (mean − f)ᵀW(mean − f)
  Vector5 constant_products_;  ///< JᵀW(mean − f)
  Eigen::Matrix<double, 5, 5> inverse_;
  Vector5 prior_pull_;
  double prior_cost_ = 0.0;
  std::vector<double> costs_;
};

}  // namespace eigenpose
