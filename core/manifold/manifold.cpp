#include "core/manifold/manifold.h"

#include <array>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/linear_algebra.h"

namespace eigenpose {

namespace {

using Weights = std::array<double, max_spline_degree + 1>;

/// Solves the interpolation problem along one axis of a tensor of columns, `inner` columns lying between
/// neighbours.
Eigen::MatrixXd solve_axis(const AxisBasis& basis, Eigen::Index samples, Eigen::Index inner,
                           const Eigen::MatrixXd& columns) {
  const Eigen::Index dims = columns.rows();
  const Eigen::Index outer = columns.cols() / (samples * inner);
  const auto count = static_cast<Eigen::Index>(basis.coefficients());
  Eigen::MatrixXd sides = Eigen::MatrixXd::Zero(count, dims * outer * inner);
  for (Eigen::Index o = 0; o < outer; ++o)
    for (Eigen::Index i = 0; i < inner; ++i)
      for (Eigen::Index j = 0; j < samples; ++j)
        sides.row(j).segment((o * inner + i) * dims, dims) =
            columns.col((o * samples + j) * inner + i).transpose();
  const Eigen::MatrixXd solved = solve_square(basis.interpolation_matrix(), sides);
  Eigen::MatrixXd result(dims, outer * count * inner);
  for (Eigen::Index o = 0; o < outer; ++o)
    for (Eigen::Index i = 0; i < inner; ++i)
      for (Eigen::Index j = 0; j < count; ++j)
        result.col((o * count + j) * inner + i) =
            solved.row(j).segment((o * inner + i) * dims, dims).transpose();
  return result;
}

}  // namespace

Eigen::MatrixXd grid_poses(std::span<const SampleAxis> axes) {
  Eigen::Index count = 1;
  for (const SampleAxis& axis : axes) count *= static_cast<Eigen::Index>(axis.samples.size());
  Eigen::MatrixXd poses(static_cast<Eigen::Index>(axes.size()), count);
  for (Eigen::Index i = 0; i < count; ++i) {
    auto rest = static_cast<std::size_t>(i);
    for (std::size_t a = axes.size(); a-- > 0;) {
      const std::vector<double>& samples = axes[a].samples;
      poses(static_cast<Eigen::Index>(a), i) = samples[rest % samples.size()];
      rest /= samples.size();
    }
  }
  return poses;
}

Manifold::Manifold(std::vector<SampleAxis> axes, int degree) : axes_(std::move(axes)), degree_(degree) {
  if (axes_.empty() || axes_.size() > max_manifold_dofs)
    throw std::invalid_argument("a manifold has 1 to " + std::to_string(max_manifold_dofs) + " axes, got " +
                                std::to_string(axes_.size()));
  bases_.reserve(axes_.size());
  for (const SampleAxis& axis : axes_) bases_.emplace_back(axis, degree);
}

Manifold Manifold::interpolate(std::vector<SampleAxis> axes, const Eigen::Ref<const Eigen::MatrixXd>& points,
                               int degree) {
  Manifold manifold(std::move(axes), degree);
  Eigen::Index expected = 1;
  for (const SampleAxis& axis : manifold.axes_) expected *= static_cast<Eigen::Index>(axis.samples.size());
  if (points.cols() != expected || points.rows() < 1)
    throw std::invalid_argument("the axes have " + std::to_string(expected) +
                                " samples together, but there are " + std::to_string(points.cols()) +
                                " points of " + std::to_string(points.rows()) + " dimensions");
  if (!points.allFinite()) throw std::invalid_argument("a point to interpolate is not finite");
  Eigen::MatrixXd columns = points;
  // From the last axis to the first, so that `inner` counts coefficients already solved for.
  Eigen::Index inner = 1;
  for (std::size_t a = manifold.axes_.size(); a-- > 0;) {
    const AxisBasis& basis = manifold.bases_[a];
    columns = solve_axis(basis, static_cast<Eigen::Index>(manifold.axes_[a].samples.size()), inner, columns);
    inner *= static_cast<Eigen::Index>(basis.coefficients());
  }
  manifold.coefficients_ = std::move(columns);
  return manifold;
}

Manifold Manifold::from_coefficients(std::vector<SampleAxis> axes, Eigen::MatrixXd coefficients, int degree) {
  Manifold manifold(std::move(axes), degree);
  Eigen::Index expected = 1;
  for (const AxisBasis& basis : manifold.bases_) expected *= static_cast<Eigen::Index>(basis.coefficients());
  if (coefficients.cols() != expected || coefficients.rows() < 1)
    throw std::invalid_argument("the axes need " + std::to_string(expected) +
                                " coefficients, but there are " + std::to_string(coefficients.cols()) +
                                " of " + std::to_string(coefficients.rows()) + " dimensions");
  manifold.coefficients_ = std::move(coefficients);
  return manifold;
}

void Manifold::derivative(std::span<const double> q, std::span<const int> orders,
                          Eigen::VectorXd& out) const {
  const std::size_t m = dofs();
  if (q.size() != m || orders.size() != m)
    throw std::invalid_argument("this manifold has " + std::to_string(m) + " DOFs, got " +
                                std::to_string(q.size()) + " values and " + std::to_string(orders.size()) +
                                " orders");
  std::array<AxisBasis::Location, max_manifold_dofs> place{};
  std::array<Weights, max_manifold_dofs> weights{};
  for (std::size_t a = 0; a < m; ++a) {
    place[a] = bases_[a].locate(q[a]);
    bases_[a].weights(place[a], orders[a], weights[a]);
  }
  out.resize(dimensions());
  out.setZero();
  std::array<int, max_manifold_dofs> k{};
  for (;;) {
    double weight = 1.0;
    std::size_t column = 0;
    for (std::size_t a = 0; a < m; ++a) {
      weight *= weights[a][k[a]];
      column = column * bases_[a].coefficients() + bases_[a].coefficient(place[a].segment, k[a]);
    }
    out.noalias() += weight * coefficients_.col(static_cast<Eigen::Index>(column));
    std::size_t a = m;
    while (a > 0 && ++k[a - 1] > bases_[a - 1].degree()) k[--a] = 0;
    if (a == 0) return;
  }
}

Eigen::VectorXd Manifold::evaluate(std::span<const double> q) const {
  Eigen::VectorXd value;
  evaluate_into(q, value);
  return value;
}

void Manifold::evaluate_into(std::span<const double> q, Eigen::VectorXd& out) const {
  const std::array<int, max_manifold_dofs> none{};
  derivative(q, std::span(none).first(dofs()), out);
}

ManifoldPoint Manifold::evaluate_with_jacobian(std::span<const double> q) const {
  ManifoldPoint point{evaluate(q), Eigen::MatrixXd(dimensions(), static_cast<Eigen::Index>(dofs()))};
  Eigen::VectorXd column;
  for (std::size_t a = 0; a < dofs(); ++a) {
    std::array<int, max_manifold_dofs> orders{};
    orders[a] = 1;
    derivative(q, std::span(orders).first(dofs()), column);
    point.jacobian.col(static_cast<Eigen::Index>(a)) = column;
  }
  return point;
}

}  // namespace eigenpose
