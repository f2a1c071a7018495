/// Manifold::fit: the penalised least-squares B-spline through samples at any poses.

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/linear_algebra.h"
#include "core/manifold/manifold.h"

namespace eigenpose {
namespace {

/// Normal equations are solved densely: 128 MB and some seconds at this size.
constexpr Eigen::Index most_coefficients = 4096;
/// A function of unit size whose values at the samples are below this does not count as seen there.
constexpr double undetermined = 1e-6;

using Weights = std::array<double, max_spline_degree + 1>;

/// ΔᵀΔ of the first and of the second divided differences along one axis, over the Greville abscissae. Each
/// row counts by the length it stands for, in mean steps, so that both are integrals along the axis.
struct AxisPenalty {
  explicit AxisPenalty(const AxisBasis& basis, const Dof& dof);
  Eigen::MatrixXd slope;
  Eigen::MatrixXd curvature;
};

AxisPenalty::AxisPenalty(const AxisBasis& basis, const Dof& dof)
    : slope(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(basis.coefficients()),
                                  static_cast<Eigen::Index>(basis.coefficients()))),
      curvature(slope) {
  const std::vector<double> at = basis.greville_abscissae();
  const auto count = static_cast<Eigen::Index>(at.size());
  if (count < 2) return;
  const bool closed = dof.periodic;
  const Eigen::Index gaps = closed ? count : count - 1;
  std::vector<double> gap(static_cast<std::size_t>(gaps));
  for (Eigen::Index i = 0; i < gaps; ++i) {
    const auto next = static_cast<std::size_t>((i + 1) % count);
    gap[static_cast<std::size_t>(i)] =
        at[next] - at[static_cast<std::size_t>(i)] + (next == 0 ? dof.period() : 0.0);
  }
  const double span = closed ? dof.period() : at.back() - at.front();
  const double step = span / static_cast<double>(gaps);
  for (Eigen::Index i = 0; i < gaps; ++i) {
    const Eigen::Index next = (i + 1) % count;
    const double width = gap[static_cast<std::size_t>(i)] / step;
    const double weight = 1.0 / width;  // (1/width)², times width
    slope(i, i) += weight;
    slope(next, next) += weight;
    slope(i, next) -= weight;
    slope(next, i) -= weight;
  }
  for (Eigen::Index i = closed ? 0 : 1; i < (closed ? count : count - 1); ++i) {
    const Eigen::Index before = (i + count - 1) % count;
    const Eigen::Index after = (i + 1) % count;
    const double left = gap[static_cast<std::size_t>(before)] / step;
    const double right = gap[static_cast<std::size_t>(i)] / step;
    const double width = 0.5 * (left + right);
    const std::array<Eigen::Index, 3> columns{before, i, after};
    const std::array<double, 3> row{1.0 / (left * width), -(1.0 / left + 1.0 / right) / width,
                                    1.0 / (right * width)};
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) curvature(columns[j], columns[k]) += width * row[j] * row[k];
  }
}

/// Indices of the coefficients of a tensor product, last axis fastest.
class CoefficientGrid {
 public:
  explicit CoefficientGrid(std::span<const AxisBasis> bases) : strides_(bases.size(), 1) {
    for (std::size_t a = bases.size(); a-- > 0;) {
      strides_[a] = total_;
      counts_.insert(counts_.begin(), static_cast<Eigen::Index>(bases[a].coefficients()));
      total_ *= counts_.front();
    }
  }
  [[nodiscard]] Eigen::Index total() const { return total_; }
  [[nodiscard]] Eigen::Index count(std::size_t a) const { return counts_[a]; }
  [[nodiscard]] Eigen::Index at(Eigen::Index cell, std::size_t a) const {
    return cell / strides_[a] % counts_[a];
  }
  /// `cell` with its index along axis a replaced by k.
  [[nodiscard]] Eigen::Index moved(Eigen::Index cell, std::size_t a, Eigen::Index k) const {
    return cell + (k - at(cell, a)) * strides_[a];
  }

 private:
  std::vector<Eigen::Index> strides_;
  std::vector<Eigen::Index> counts_;
  Eigen::Index total_ = 1;
};

/// Adds `weight` times the penalty to the normal matrix.
void add_penalty(std::span<const AxisBasis> bases, std::span<const SampleAxis> axes,
                 const CoefficientGrid& grid, double weight, Eigen::MatrixXd& normal) {
  std::vector<AxisPenalty> penalties;
  penalties.reserve(bases.size());
  for (std::size_t a = 0; a < bases.size(); ++a) penalties.emplace_back(bases[a], axes[a].dof);
  for (Eigen::Index cell = 0; cell < grid.total(); ++cell)
    for (std::size_t a = 0; a < bases.size(); ++a) {
      const Eigen::Index i = grid.at(cell, a);
      for (Eigen::Index k = 0; k < grid.count(a); ++k) {
        const Eigen::Index beside = grid.moved(cell, a, k);
        normal(beside, cell) += weight * penalties[a].curvature(k, i);
        if (penalties[a].slope(k, i) == 0.0) continue;
        for (std::size_t b = a + 1; b < bases.size(); ++b)
          for (Eigen::Index l = 0; l < grid.count(b); ++l)
            normal(grid.moved(beside, b, l), cell) +=
                2.0 * weight * penalties[a].slope(k, i) * penalties[b].slope(l, grid.at(cell, b));
      }
    }
}

/// Basis functions that do not vanish at one pose.
struct ActiveFunctions {
  std::vector<Eigen::Index> columns;
  std::vector<double> weights;
};

void find_active(std::span<const AxisBasis> bases, const Eigen::Ref<const Eigen::VectorXd>& pose,
                 ActiveFunctions& active) {
  active.columns.assign(1, 0);
  active.weights.assign(1, 1.0);
  for (std::size_t a = 0; a < bases.size(); ++a) {
    const AxisBasis& basis = bases[a];
    const auto place = basis.locate(pose(static_cast<Eigen::Index>(a)));
    Weights along{};
    basis.weights(place, 0, along);
    ActiveFunctions next;
    for (std::size_t i = 0; i < active.columns.size(); ++i)
      for (int k = 0; k <= basis.degree(); ++k) {
        next.columns.push_back(active.columns[i] * static_cast<Eigen::Index>(basis.coefficients()) +
                               static_cast<Eigen::Index>(basis.coefficient(place.segment, k)));
        next.weights.push_back(active.weights[i] * along[static_cast<std::size_t>(k)]);
      }
    active = std::move(next);
  }
}

void check_fit(const Eigen::Ref<const Eigen::MatrixXd>& poses,
               const Eigen::Ref<const Eigen::MatrixXd>& points, std::size_t dofs, Eigen::Index coefficients,
               double smoothing) {
  if (poses.rows() != static_cast<Eigen::Index>(dofs) || poses.cols() != points.cols() || points.rows() < 1)
    throw std::invalid_argument(std::to_string(points.cols()) + " points of " +
                                std::to_string(points.rows()) + " dimensions do not fit " +
                                std::to_string(poses.cols()) + " poses of " + std::to_string(poses.rows()) +
                                " DOFs on " + std::to_string(dofs) + " axes");
  if (!points.allFinite() || !poses.allFinite())
    throw std::invalid_argument("a point or a pose to fit is not finite");
  if (!(smoothing > 0.0) || !std::isfinite(smoothing))
    throw std::invalid_argument("the smoothing of a fit is " + std::to_string(smoothing) +
                                ", it must be above 0");
  if (coefficients > most_coefficients)
    throw std::invalid_argument("a fit of " + std::to_string(coefficients) +
                                " coefficients is too large; at most " + std::to_string(most_coefficients) +
                                " are solved for");
}

}  // namespace

std::string Manifold::undetermined_dof(std::span<const SampleAxis> axes,
                                       const Eigen::Ref<const Eigen::MatrixXd>& poses) {
  // Functions without penalty: constants, and lines along open axes. Those seen so far, orthonormal.
  const double count = static_cast<double>(poses.cols());
  Eigen::MatrixXd seen = Eigen::MatrixXd::Constant(poses.cols(), 1, 1.0 / std::sqrt(count));
  for (std::size_t a = 0; a < axes.size(); ++a) {
    if (axes[a].dof.periodic || axes[a].samples.size() < 2) continue;
    const double first = axes[a].samples.front();
    const double range = axes[a].samples.back() - first;
    Eigen::VectorXd line = (poses.row(static_cast<Eigen::Index>(a)).transpose().array() - first) / range;
    line = line.cwiseMax(0.0).cwiseMin(1.0);
    for (int pass = 0; pass < 2; ++pass) line -= seen * (seen.transpose() * line);
    if (line.norm() < undetermined * std::sqrt(count)) return axes[a].dof.name;
    seen.conservativeResize(Eigen::NoChange, seen.cols() + 1);
    seen.col(seen.cols() - 1) = line.normalized();
  }
  return {};
}

Manifold Manifold::fit(std::vector<SampleAxis> axes, const Eigen::Ref<const Eigen::MatrixXd>& poses,
                       const Eigen::Ref<const Eigen::MatrixXd>& points, const FitOptions& options) {
  if (poses.size() == 0) return interpolate(std::move(axes), points, options.degree);
  Manifold manifold(std::move(axes), options.degree);
  const CoefficientGrid grid(manifold.bases_);
  check_fit(poses, points, manifold.dofs(), grid.total(), options.smoothing);
  if (const std::string dof = undetermined_dof(manifold.axes_, poses); !dof.empty())
    throw std::invalid_argument("the samples do not determine the manifold along \"" + dof +
                                "\": they stand at one value of it, or it follows from the other DOFs; add "
                                "samples at other values");
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(grid.total(), grid.total());
  Eigen::MatrixXd sides = Eigen::MatrixXd::Zero(grid.total(), points.rows());
  ActiveFunctions active;
  for (Eigen::Index i = 0; i < poses.cols(); ++i) {
    find_active(manifold.bases_, poses.col(i), active);
    for (std::size_t j = 0; j < active.columns.size(); ++j) {
      sides.row(active.columns[j]) += active.weights[j] * points.col(i).transpose();
      for (std::size_t k = 0; k < active.columns.size(); ++k)
        normal(active.columns[j], active.columns[k]) += active.weights[j] * active.weights[k];
    }
  }
  const double share = static_cast<double>(poses.cols()) / static_cast<double>(grid.total());
  add_penalty(manifold.bases_, manifold.axes_, grid, options.smoothing * share, normal);
  const auto solved = solve_positive_definite_in_place(normal, sides);
  if (!solved || !solved->allFinite())
    throw std::invalid_argument("the samples do not determine the manifold; add some, or smooth more");
  manifold.coefficients_ = solved->transpose();
  return manifold;
}

}  // namespace eigenpose
