#include "core/manifold/geometry.h"

#include <array>
#include <stdexcept>
#include <string>

#include "core/base/linear_algebra.h"

namespace eigenpose {

namespace {

/// Columns of the Jacobian shorter than this share of the longest do not count as directions.
constexpr double singular = 1e-9;

}  // namespace

ManifoldGeometry manifold_geometry(const Manifold& manifold, std::span<const double> q,
                                   std::span<const double> direction) {
  const std::size_t m = manifold.dofs();
  if (direction.size() != m)
    throw std::invalid_argument("this manifold has " + std::to_string(m) + " DOFs, the direction has " +
                                std::to_string(direction.size()));
  const Eigen::Map<const Eigen::VectorXd> along(direction.data(), static_cast<Eigen::Index>(m));
  if (!(along.norm() > 0.0)) throw std::invalid_argument("the direction is zero");

  const ManifoldPoint at = manifold.evaluate_with_jacobian(q);
  ManifoldGeometry result;
  const Eigen::VectorXd velocity = at.jacobian * along;
  result.speed = velocity.norm();
  result.tangent = result.speed > 0.0 ? Eigen::VectorXd(velocity / result.speed)
                                      : Eigen::VectorXd(Eigen::VectorXd::Zero(velocity.size()));
  result.tangents = orthonormal_span(at.jacobian, singular);

  Eigen::VectorXd bend = Eigen::VectorXd::Zero(velocity.size());
  Eigen::VectorXd second;
  for (std::size_t a = 0; a < m; ++a)
    for (std::size_t b = 0; b < m; ++b) {
      std::array<int, max_manifold_dofs> orders{};
      ++orders[a];
      ++orders[b];
      manifold.derivative(q, std::span(orders).first(m), second);
      bend += direction[a] * direction[b] * second;
    }
  bend -= result.tangents * (result.tangents.transpose() * bend);
  const double size = bend.norm();
  result.normal = size > 0.0 ? Eigen::VectorXd(bend / size) : bend;
  result.curvature = result.speed > 0.0 ? size / (result.speed * result.speed) : 0.0;
  return result;
}

ManifoldGeometry curve_geometry(const Manifold& curve, double q) {
  if (curve.dofs() != 1)
    throw std::invalid_argument("a curve has 1 DOF, this manifold has " + std::to_string(curve.dofs()));
  const double forward = 1.0;
  return manifold_geometry(curve, {&q, 1}, {&forward, 1});
}

}  // namespace eigenpose
