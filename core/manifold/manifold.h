#pragma once

/// The appearance manifold: a tensor-product B-spline f(q) through an object's projections (eq. 8).
///
/// Data stand at the *centres* of the basis functions (for degree 2: f_i = ⅛c_{i−1} + ¾c_i + ⅛c_{i+1}), where
/// interpolation is well conditioned for any number of samples, periodic or open. Never at the knots.
/// Non-uniform samples: axis_basis.h.

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/workspace.h"
#include "core/manifold/axis_basis.h"

namespace eigenpose {

/// Largest number of DOFs of a manifold.
inline constexpr std::size_t max_manifold_dofs = 4;

/// Value and first derivatives of f at one q.
struct ManifoldPoint {
  Eigen::VectorXd value;     ///< K
  Eigen::MatrixXd jacobian;  ///< K × m, per unit of each DOF
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
