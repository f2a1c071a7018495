#pragma once

/// The B-spline basis along one degree of freedom: knots, segments and the Bézier form of each segment.
///
/// Even degree (2): knots lie halfway between samples, so each sample stands at the centre of its own
/// segment. Odd degree (1, 3): knots lie on the samples. On uniform samples this gives the centred formulas
/// f_i = ⅛c_{i−1} + ¾c_i + ⅛c_{i+1} (degree 2) and ⅙, ⅔, ⅙ (degree 3); on non-uniform samples the general
/// B-splines of the same knots, whose interpolation matrix is totally positive and therefore never singular
/// (Schoenberg–Whitney: every sample lies inside the support of its own basis function).
///
/// An open axis of degree 2 or 3 has one ghost coefficient beyond each end. They are fixed by leaving out the
/// knot nearest the end ("not a knot"), so that polynomials of the degree are reproduced up to the ends and
/// the error there is of the same order as inside; a vanishing second difference would cost one order.

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/workspace.h"

namespace eigenpose {

/// The sample positions along one DOF, ascending, in the DOF's unit; strictly increasing, inside [lower,
/// upper) for a periodic DOF. A periodic axis needs ≥ 3 samples, an open one ≥ 2; an axis with 1 sample is
/// constant.
struct SampleAxis {
  Dof dof;
  std::vector<double> samples;
};

/// Highest degree of a basis.
inline constexpr int max_spline_degree = 3;

/// Basis functions of one axis. Immutable; const calls are thread-safe.
///
/// The axis is cut into segments [begin(s), end(s)]; on each, degree()+1 coefficients act. A position inside
/// a segment is u ∈ [0, 1].
class AxisBasis {
 public:
  /// @throws std::invalid_argument for samples that are too few, not ascending, not finite, or outside the
  /// period, and for a degree other than 1, 2, 3.
  AxisBasis(const SampleAxis& axis, int degree);

  /// The degree in use: 0 for a single sample, at most samples − 1 on an open axis.
  [[nodiscard]] int degree() const { return degree_; }
  [[nodiscard]] std::size_t coefficients() const { return coefficients_; }
  [[nodiscard]] std::size_t segments() const { return breaks_.size() - 1; }
  [[nodiscard]] double begin(std::size_t segment) const { return breaks_[segment]; }
  [[nodiscard]] double end(std::size_t segment) const { return breaks_[segment + 1]; }

  /// A place on the axis.
  struct Location {
    std::size_t segment = 0;
    double u = 0.0;
  };
  /// Periodic: any q. Open: q is clamped to the first and last sample.
  [[nodiscard]] Location locate(double q) const;
  /// The value of the DOF at a place; the inverse of locate, canonical if periodic.
  [[nodiscard]] double position(Location place) const;

  /// Number of the k-th coefficient that acts on `segment`, 0 ≤ k ≤ degree().
  [[nodiscard]] std::size_t coefficient(std::size_t segment, int k) const {
    return (segment + static_cast<std::size_t>(k) + offset_) % coefficients_;
  }
  /// (degree+1)² numbers, row by row: Bézier point j of the segment is Σ_k extraction[j][k] · c_k. Entries
  /// are ≥ 0 and rows sum to 1, so that the segment lies in the convex hull of its coefficients too.
  [[nodiscard]] std::span<const double> extraction(std::size_t segment) const {
    const std::size_t size = static_cast<std::size_t>((degree_ + 1) * (degree_ + 1));
    return std::span(extraction_).subspan(segment * size, size);
  }
  /// Weights of the coefficients acting at `place`, of the derivative of that order with respect to the DOF.
  /// @pre weights.size() ≥ degree()+1, order ≥ 0.
  void weights(Location place, int order, std::span<double> weights) const;

  /// The Greville abscissae ξ: the function Σ ξ_i B_i is the position itself, along an open axis everywhere,
  /// along a periodic one away from the seam. Ascending; one a coefficient, the first beyond the first sample
  /// where the axis has ghosts. All 0 for degree 0.
  [[nodiscard]] std::vector<double> greville_abscissae() const;

  /// The square matrix A of the interpolation problem A c = (samples, 0, 0): one row a sample, then the end
  /// conditions if any.
  [[nodiscard]] Eigen::MatrixXd interpolation_matrix() const;

 private:
  [[nodiscard]] double sample(std::ptrdiff_t i) const;
  [[nodiscard]] double knot(std::ptrdiff_t i) const;
  void extract(std::size_t segment);

  std::vector<double> samples_;
  Dof dof_;
  int degree_ = 0;
  bool periodic_ = false;
  std::size_t coefficients_ = 1;
  std::size_t offset_ = 0;          ///< coefficient(s, 0) = s + offset_, modulo the count if periodic
  std::vector<double> breaks_;      ///< segments + 1, ascending
  std::vector<double> extraction_;  ///< segments × (degree+1)²
};

}  // namespace eigenpose
