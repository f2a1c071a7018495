#include "core/search/rbf_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include "core/base/linear_algebra.h"
#include "core/base/statistics.h"
#include "core/manifold/sample_grid.h"

namespace eigenpose {

namespace {

struct Unit {
  Eigen::Index sample = 0;
  double exponent = 0.0;
};

/// Squared distances between all samples.
Eigen::MatrixXd squared_distances(const Eigen::MatrixXd& points) {
  const Eigen::VectorXd norms = points.colwise().squaredNorm();
  Eigen::MatrixXd d = -2.0 * points.transpose() * points;
  d.colwise() += norms;
  d.rowwise() += norms.transpose();
  return d.cwiseMax(0.0);
}

/// Responses of one unit at all samples.
Eigen::VectorXd response(const Eigen::MatrixXd& squared, const Unit& unit) {
  return (-unit.exponent * squared.col(unit.sample)).array().exp();
}

/// Units tried in each round of taking away.
constexpr std::size_t pruning_trials = 5;

struct Solution {
  Eigen::MatrixXd weights;  ///< L × (1 + units)
  double largest_error = 0.0;
  std::vector<double> cost;  ///< per unit: squared error that leaving it out adds
};

/// Least squares for all weights, the constant among them.
Solution solve(const Eigen::MatrixXd& squared, const std::vector<Unit>& units, const Eigen::MatrixXd& targets,
               double ridge) {
  const Eigen::Index n = squared.cols();
  Eigen::MatrixXd design(n, static_cast<Eigen::Index>(units.size()) + 1);
  design.col(0).setOnes();
  for (std::size_t i = 0; i < units.size(); ++i)
    design.col(static_cast<Eigen::Index>(i) + 1) = response(squared, units[i]);
  Eigen::MatrixXd normal = design.transpose() * design;
  normal.diagonal() *= 1.0 + ridge;
  Solution result;
  const auto [solution, inverse] = solve_symmetric(normal, design.transpose() * targets.transpose());
  result.weights = solution.transpose();
  for (Eigen::Index i = 1; i < normal.rows(); ++i)
    result.cost.push_back(result.weights.col(i).squaredNorm() / std::max(inverse(i, i), 1e-300));
  result.largest_error = (design * result.weights.transpose() - targets.transpose()).cwiseAbs().maxCoeff();
  return result;
}

/// Half the median distance to the nearest other sample.
double smallest_width(const Eigen::MatrixXd& squared) {
  std::vector<double> nearest;
  for (Eigen::Index i = 0; i < squared.cols(); ++i) {
    double best = std::numeric_limits<double>::infinity();
    for (Eigen::Index j = 0; j < squared.cols(); ++j)
      if (j != i && squared(j, i) > 0.0) best = std::min(best, squared(j, i));
    if (std::isfinite(best)) nearest.push_back(std::sqrt(best));
  }
  if (nearest.empty()) return 1.0;
  return 0.5 * upper_median(nearest);
}

/// All possible units, made orthogonal to the ones chosen already.
class Pursuit {
 public:
  Pursuit(const Eigen::MatrixXd& squared, const Eigen::MatrixXd& targets, int widths)
      : residual_(targets.transpose()) {
    double width = smallest_width(squared);
    for (int w = 0; w < widths; ++w, width *= 2.0)
      for (Eigen::Index i = 0; i < squared.cols(); ++i) units_.push_back({i, 0.5 / (width * width)});
    columns_.resize(squared.cols(), static_cast<Eigen::Index>(units_.size()));
    for (std::size_t u = 0; u < units_.size(); ++u)
      columns_.col(static_cast<Eigen::Index>(u)) = response(squared, units_[u]);
    full_ = columns_.colwise().squaredNorm();
    project_out(Eigen::VectorXd::Ones(squared.cols()) / std::sqrt(static_cast<double>(squared.cols())));
  }

  /// Adds the unit that takes most energy from the residual; false when none is independent of those chosen.
  bool add(std::vector<Unit>& chosen) {
    const Eigen::VectorXd energy = columns_.colwise().squaredNorm();
    const Eigen::MatrixXd products = columns_.transpose() * residual_;
    Eigen::Index best = -1;
    double most = 0.0;
    for (Eigen::Index u = 0; u < energy.size(); ++u) {
      if (energy[u] < independent * full_[u]) continue;
      const double gain = products.row(u).squaredNorm() / energy[u];
      if (gain > most) {
        most = gain;
        best = u;
      }
    }
    if (best < 0) return false;
    chosen.push_back(units_[static_cast<std::size_t>(best)]);
    project_out(columns_.col(best) / std::sqrt(energy[best]));
    return true;
  }
  [[nodiscard]] double largest_error() const { return residual_.cwiseAbs().maxCoeff(); }

 private:
  /// A unit of which less than this share is left is a combination of the others.
  static constexpr double independent = 1e-8;

  void project_out(const Eigen::VectorXd& direction) {
    columns_ -= direction * (direction.transpose() * columns_).eval();
    residual_ -= direction * (direction.transpose() * residual_).eval();
  }

  std::vector<Unit> units_;
  Eigen::MatrixXd columns_;   ///< samples × candidates
  Eigen::VectorXd full_;      ///< energy of each before anything was projected out
  Eigen::MatrixXd residual_;  ///< samples × L
};

/// The samples of a manifold, and the outputs of a pose network wanted there.
struct PoseSamples {
  Eigen::MatrixXd points;   ///< K × n
  Eigen::MatrixXd targets;  ///< cos and sin of periodic DOFs, −1…1 for open ones
};

PoseSamples samples_of(const Manifold& f) {
  const Grid grid = grid_of(f.axes());
  Eigen::Index outputs = 0;
  for (const SampleAxis& axis : f.axes()) outputs += axis.dof.periodic ? 2 : 1;
  const auto count = static_cast<Eigen::Index>(grid.size());
  PoseSamples result{Eigen::MatrixXd(f.dimensions(), count), Eigen::MatrixXd(outputs, count)};
  std::vector<double> q(f.dofs());
  for (Eigen::Index i = 0; i < count; ++i) {
    Eigen::Index row = 0;
    for (std::size_t a = 0; a < f.dofs(); ++a) {
      const Dof& dof = f.axes()[a].dof;
      q[a] = f.axes()[a].samples[grid.index(static_cast<std::size_t>(i), a)];
      const double share = (q[a] - dof.lower) / dof.period();
      if (dof.periodic) {
        result.targets(row++, i) = std::cos(2.0 * std::numbers::pi * share);
        result.targets(row++, i) = std::sin(2.0 * std::numbers::pi * share);
      } else {
        result.targets(row++, i) = 2.0 * share - 1.0;
      }
    }
    result.points.col(i) = f.evaluate(q);
  }
  return result;
}

}  // namespace

RbfNetwork RbfNetwork::fit(const Eigen::Ref<const Eigen::MatrixXd>& points,
                           const Eigen::Ref<const Eigen::MatrixXd>& targets, const RbfOptions& options,
                           RbfReport* report) {
  if (points.cols() == 0 || points.cols() != targets.cols())
    throw std::invalid_argument("a network needs as many targets as points, got " +
                                std::to_string(targets.cols()) + " for " + std::to_string(points.cols()));
  if (!(options.max_error > 0.0) || options.widths < 1 || !(options.ridge >= 0.0))
    throw std::invalid_argument("network options out of range: max_error " +
                                std::to_string(options.max_error) + ", widths " +
                                std::to_string(options.widths) + ", ridge " + std::to_string(options.ridge));
  const Eigen::MatrixXd squared = squared_distances(points);
  const std::size_t most =
      options.max_units == 0 ? static_cast<std::size_t>(points.cols()) : options.max_units;
  std::vector<Unit> units;
  Solution solution = solve(squared, units, targets, options.ridge);
  Pursuit pursuit(squared, targets, options.widths);
  while (solution.largest_error > options.max_error && units.size() < most && pursuit.add(units))
    if (pursuit.largest_error() <= options.max_error)
      solution = solve(squared, units, targets, options.ridge);
  solution = solve(squared, units, targets, options.ridge);

  // Backward: leave out what the bound can spare, the units first that the squared error misses least.
  std::size_t pruned = 0;
  while (solution.largest_error <= options.max_error && !units.empty()) {
    std::vector<std::size_t> order(units.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const std::size_t trials = std::min(pruning_trials, order.size());
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(trials), order.end(),
                      [&](std::size_t x, std::size_t y) { return solution.cost[x] < solution.cost[y]; });
    bool spared = false;
    for (std::size_t trial = 0; trial < trials && !spared; ++trial) {
      std::vector<Unit> fewer = units;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(order[trial]));
      Solution without = solve(squared, fewer, targets, options.ridge);
      if (without.largest_error > options.max_error) continue;
      units = std::move(fewer);
      solution = std::move(without);
      ++pruned;
      spared = true;
    }
    if (!spared) break;
  }

  RbfNetwork network;
  network.centres_.resize(points.rows(), static_cast<Eigen::Index>(units.size()));
  network.exponent_.resize(static_cast<Eigen::Index>(units.size()));
  for (std::size_t i = 0; i < units.size(); ++i) {
    network.centres_.col(static_cast<Eigen::Index>(i)) = points.col(units[i].sample);
    network.exponent_[static_cast<Eigen::Index>(i)] = units[i].exponent;
  }
  network.weights_ = solution.weights;
  if (report != nullptr)
    *report = {units.size(), pruned, solution.largest_error, solution.largest_error <= options.max_error};
  return network;
}

Eigen::VectorXd RbfNetwork::evaluate(const Eigen::Ref<const Eigen::VectorXd>& point) const {
  Eigen::VectorXd result = weights_.col(0);
  for (Eigen::Index i = 0; i < centres_.cols(); ++i)
    result += std::exp(-exponent_[i] * (point - centres_.col(i)).squaredNorm()) * weights_.col(i + 1);
  return result;
}

RbfRecognizer::RbfRecognizer(std::span<const Manifold> manifolds, const RbfOptions& options) {
  if (manifolds.empty()) throw std::invalid_argument("networks need at least one manifold, got 0");
  dimensions_ = manifolds[0].dimensions();
  std::vector<Eigen::MatrixXd> points;
  Eigen::Index total = 0;
  for (const Manifold& f : manifolds) {
    if (f.dimensions() != dimensions_)
      throw std::invalid_argument("a manifold has " + std::to_string(f.dimensions()) +
                                  " dimensions, the first one has " + std::to_string(dimensions_));
    axes_.emplace_back(f.axes().begin(), f.axes().end());
    PoseSamples samples = samples_of(f);
    RbfReport report;
    poses_.push_back(RbfNetwork::fit(samples.points, samples.targets, options, &report));
    unmet_ += report.bound_met ? 0 : 1;
    total += samples.points.cols();
    points.push_back(std::move(samples.points));
  }
  Eigen::MatrixXd all(dimensions_, total);
  Eigen::MatrixXd owner = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(manifolds.size()), total);
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    all.middleCols(at, points[i].cols()) = points[i];
    owner.row(static_cast<Eigen::Index>(i)).segment(at, points[i].cols()).setOnes();
    at += points[i].cols();
  }
  // The winner is told by the largest output: an error below a half cannot change it.
  RbfOptions coarse = options;
  coarse.max_error = std::max(options.max_error, 0.25);
  RbfReport report;
  object_ = RbfNetwork::fit(all, owner, coarse, &report);
  unmet_ += report.bound_met ? 0 : 1;
}

std::vector<double> RbfRecognizer::pose(std::size_t manifold,
                                        const Eigen::Ref<const Eigen::VectorXd>& point) const {
  const Eigen::VectorXd outputs = poses_.at(manifold).evaluate(point);
  std::vector<double> q;
  Eigen::Index row = 0;
  for (const SampleAxis& axis : axes_[manifold]) {
    const Dof& dof = axis.dof;
    if (dof.periodic) {
      const double share = std::atan2(outputs[row + 1], outputs[row]) / (2.0 * std::numbers::pi);
      q.push_back(dof.canonical(dof.lower + share * dof.period()));
      row += 2;
    } else {
      q.push_back(std::clamp(dof.lower + 0.5 * (outputs[row] + 1.0) * dof.period(), dof.lower, dof.upper));
      row += 1;
    }
  }
  return q;
}

Eigen::VectorXd RbfRecognizer::scores(const Eigen::Ref<const Eigen::VectorXd>& point) const {
  if (point.size() != dimensions_)
    throw std::invalid_argument("the networks take " + std::to_string(dimensions_) +
                                " numbers, the point has " + std::to_string(point.size()));
  return object_.evaluate(point);
}

RbfRecognizer::Estimate RbfRecognizer::recognize(const Eigen::Ref<const Eigen::VectorXd>& point) const {
  Estimate estimate;
  Eigen::Index winner = 0;
  estimate.score = scores(point).maxCoeff(&winner);
  estimate.manifold = static_cast<std::size_t>(winner);
  estimate.q = pose(estimate.manifold, point);
  return estimate;
}

std::size_t RbfRecognizer::memory() const {
  std::size_t bytes = object_.memory();
  for (const RbfNetwork& network : poses_) bytes += network.memory();
  return bytes;
}

std::size_t RbfRecognizer::units() const {
  std::size_t count = object_.units();
  for (const RbfNetwork& network : poses_) count += network.units();
  return count;
}

}  // namespace eigenpose
