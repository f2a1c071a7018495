#pragma once

/// The appearance manifold: a tensor-product B-spline f(q) through an object's projections (eq. 8).
///
/// Data stand at the *centres* of the basis functions (for degree 2: f_i = ⅛c_{i−1} + ¾c_i + ⅛c_{i+1}), where
/// interpolation is well conditioned for any number of samples, periodic or open. Never at the knots.
/// Non-uniform samples along an axis keep a knot each (axis_basis.h): on random views (see
/// `FitOptions`) that errs by 0.050, no more than an even spline, and passes the samples exactly. Samples
/// that are no grid: `Manifold::fit`.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/workspace.h"
#include "core/manifold/axis_basis.h"

namespace eigenpose {

/// Largest number of DOFs of a manifold.
inline constexpr std::size_t max_manifold_dofs = 4;

/// m × n₁·…·n_m: the poses of a grid, the last axis running fastest.
Eigen::MatrixXd grid_poses(std::span<const SampleAxis> axes);

/// Value and first derivatives of f at one q.
struct ManifoldPoint {
  Eigen::VectorXd value;     ///< K
  Eigen::MatrixXd jacobian;  ///< K × m, per unit of each DOF
};

/// How samples that are no grid are fitted.
struct FitOptions {
  int degree = 2;  ///< 1, 2 or 3, as of `Manifold::interpolate`
  /// λ of the penalty on curvature, see `Manifold::fit`; > 0, without unit. Measured on COIL-20 with 36 of
  /// the 72 views of each object, chosen at random, on 36 even coefficients: root mean square error at the
  /// other views 0.049 with 1e-2, 0.060 with 1e-3, 0.101 with 1e-4; on even views 0.0261 instead of 0.0258.
  double smoothing = 1e-2;
};

/// A smooth map from m DOFs to K dimensions. Value type; const calls are thread-safe.
class Manifold {
 public:
  /// Passes through all points. Solves one axis after the other, densely: O(n_a³) for the matrix of axis a,
  /// once, and O(n_a) work per number of `points`.
  /// @param points K × (n₁·…·n_m), the *last* axis running fastest.
  /// @param degree 2 or 3 (1 is linear interpolation). An open axis of n samples uses at most n − 1.
  /// @throws std::invalid_argument for shapes that do not fit (both sizes are shown), unordered samples, or
  /// more than `max_manifold_dofs` axes.
  static Manifold interpolate(std::vector<SampleAxis> axes, const Eigen::Ref<const Eigen::MatrixXd>& points,
                              int degree = 2);
  /// Through samples at any poses: any number, at any places, a grid with holes or no grid at all.
  ///
  /// With B (n × N) the basis functions of `axes` at the n poses and c (N × K) the coefficients, it minimises
  ///     ‖B c − pᵀ‖² + λ (n/N) (Σ_a ‖Δ_a² c‖² + 2 Σ_{a<b} ‖Δ_a Δ_b c‖²)
  /// where Δ_a is the divided difference of the coefficients along axis a over their Greville abscissae,
  /// times the axis' mean step: the penalised B-spline of Eilers and Marx (Statistical Science 11, 1996),
  /// whose penalty is the integral of the squared second derivatives up to a constant. Functions linear along
  /// open axes and constant along periodic ones have no penalty: they are reproduced exactly. All else passes
  /// the samples at a residual that falls with λ.
  ///
  /// The minimum is unique when no such function but 0 vanishes at all samples: when the poses do not lie in
  /// one hyperplane of the open DOFs. Gaps need no sample: the penalty alone decides there.
  /// Cost: O(n (degree+1)^2m + N³/3 + N² K), N ≤ 4096.
  ///
  /// @param axes of the spline: its coefficients stand at their samples; poses need not.
  /// @param poses m × n, periodic DOFs at any turn, open ones clamped to the axis. 0 × 0: the full grid of
  /// `axes`, which `interpolate` passes through exactly.
  /// @param points K × n. Equal poses are allowed: the fit goes through their mean.
  /// @throws std::invalid_argument as `interpolate`; for poses that leave the minimum undetermined, saying
  /// along which DOF; for a smoothing that is not above 0.
  static Manifold fit(std::vector<SampleAxis> axes, const Eigen::Ref<const Eigen::MatrixXd>& poses,
                      const Eigen::Ref<const Eigen::MatrixXd>& points, const FitOptions& options = {});
  /// The name of the first DOF along which a fit through `poses` on `axes` would be undetermined; empty where
  /// the minimum is unique.
  static std::string undetermined_dof(std::span<const SampleAxis> axes,
                                      const Eigen::Ref<const Eigen::MatrixXd>& poses);
  /// Rebuilds a manifold from what a model file stores. @throws std::invalid_argument as above.
  static Manifold from_coefficients(std::vector<SampleAxis> axes, Eigen::MatrixXd coefficients, int degree);

  [[nodiscard]] std::size_t dofs() const { return axes_.size(); }                 ///< m
  [[nodiscard]] Eigen::Index dimensions() const { return coefficients_.rows(); }  ///< K
  [[nodiscard]] std::span<const SampleAxis> axes() const { return axes_; }
  /// The basis along each axis: segments and the coefficients that act on them.
  [[nodiscard]] std::span<const AxisBasis> bases() const { return bases_; }
  [[nodiscard]] int degree() const { return degree_; }
  /// K × number of coefficients, last axis fastest like `points`. A periodic axis has one coefficient a
  /// sample; an open one of degree 2 or 3 has two more, one beyond each end.
  [[nodiscard]] const Eigen::MatrixXd& coefficients() const { return coefficients_; }

  /// f(q), into `out`, as `derivative` writes it.
  void evaluate_into(std::span<const double> q, Eigen::VectorXd& out) const;
  /// f(q). Periodic DOFs take any value; open ones are clamped to their first and last sample.
  /// @throws std::invalid_argument when q.size() ≠ m.
  [[nodiscard]] Eigen::VectorXd evaluate(std::span<const double> q) const;
  [[nodiscard]] ManifoldPoint evaluate_with_jacobian(std::span<const double> q) const;
  /// The mixed partial derivative of f at q, `orders[a]` times along axis a; all zeros gives f(q). At a break
  /// between segments: of the segment above. Writes K numbers into `out`, which is resized if it has another
  /// size; allocates nothing otherwise. @throws std::invalid_argument when q or orders has not m entries.
  void derivative(std::span<const double> q, std::span<const int> orders, Eigen::VectorXd& out) const;

 private:
  Manifold(std::vector<SampleAxis> axes, int degree);

  std::vector<SampleAxis> axes_;
  std::vector<AxisBasis> bases_;
  Eigen::MatrixXd coefficients_;
  int degree_ = 2;
};

}  // namespace eigenpose
