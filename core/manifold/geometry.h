#pragma once

/// Tangent, normal and curvature of a manifold.

#include <span>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose {

/// The shape of f near q, along one direction of the workspace.
struct ManifoldGeometry {
  /// K × r, orthonormal: spans the tangent space. r = m, or less where f is singular (an appearance that does
  /// not change with some DOF).
  Eigen::MatrixXd tangents;
  /// K, unit: the direction in which f moves; zero where it does not move.
  Eigen::VectorXd tangent;
  /// K, unit: the direction in which f bends away from its tangent space; zero where it does not bend.
  Eigen::VectorXd normal;
  /// Normal curvature, 1/length in the eigenspace: ‖second derivative ⟂ tangent space‖ / ‖first derivative‖².
  /// For m = 1 the curvature of the curve.
  double curvature = 0.0;
  /// ‖df/dt‖: how fast the appearance changes along the direction, eigenspace length per unit of it.
  double speed = 0.0;
};

/// @param direction m numbers, in the units of the DOFs; any length but zero. The result depends on it only
/// through its direction, except `speed`.
/// @throws std::invalid_argument when q or direction has not m entries, or direction is zero.
ManifoldGeometry manifold_geometry(const Manifold& manifold, std::span<const double> q,
                                   std::span<const double> direction);

/// Along the only DOF of a curve. @throws std::invalid_argument for m ≠ 1.
ManifoldGeometry curve_geometry(const Manifold& curve, double q);

}  // namespace eigenpose
