#pragma once

/// The appearance manifold: a tensor-product B-spline f(q) through an object's projections (eq. 8).
///
/// Data stand at the *centres* of the basis functions (for degree 2: f_i = ⅛c_{i−1} + ¾c_i + ⅛c_{i+1}), where
/// interpolation is well conditioned for any number of samples, periodic or open. Never at the knots.

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

/// Value and first derivatives of f at one q.
struct ManifoldPoint {
  Eigen::VectorXd value;     ///< K
  Eigen::MatrixXd jacobian;  ///< K × m, per unit of each DOF
};

/// A smooth map from m DOFs to K dimensions. Value type; const calls are thread-safe.
class Manifold {
 public:
  /// @param points K × (n₁·…·n_m), the *last* axis running fastest.
  /// @param degree 2 or 3 (1 is linear interpolation).
  /// @throws std::invalid_argument for shapes that do not fit (both sizes are shown) or unordered samples.
  static Manifold interpolate(std::vector<SampleAxis> axes, const Eigen::Ref<const Eigen::MatrixXd>& points,
                              int degree = 2);
  /// Rebuilds a manifold from what a model file stores.
  static Manifold from_coefficients(std::vector<SampleAxis> axes, Eigen::MatrixXd coefficients, int degree);

  [[nodiscard]] std::size_t dofs() const { return axes_.size(); }                 ///< m
  [[nodiscard]] Eigen::Index dimensions() const { return coefficients_.rows(); }  ///< K
  [[nodiscard]] std::span<const SampleAxis> axes() const { return axes_; }
  [[nodiscard]] int degree() const { return degree_; }
  /// K × number of coefficients, same order as `points`.
  [[nodiscard]] const Eigen::MatrixXd& coefficients() const { return coefficients_; }

  /// f(q). Periodic DOFs take any value; open ones are clamped to their first and last sample.
  [[nodiscard]] Eigen::VectorXd evaluate(std::span<const double> q) const;
  [[nodiscard]] ManifoldPoint evaluate_with_jacobian(std::span<const double> q) const;

 private:
  std::vector<SampleAxis> axes_;
  Eigen::MatrixXd coefficients_;
  int degree_ = 2;
};

}  // namespace eigenpose
