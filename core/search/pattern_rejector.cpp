#include "core/search/pattern_rejector.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "core/search/best_list.h"

namespace eigenpose {

namespace {

/// Directions tried for one component: the leading principal directions of the class centres.
constexpr Eigen::Index tried_directions = 3;
/// Steps of subspace iteration; any unit direction keeps the guarantee, a better one rejects more.
constexpr int iterations = 12;
/// Widens intervals against rounding of dot products in double.
constexpr double rounding = 1e-12;

/// Orthonormal leading principal directions of the columns, K × at most tried_directions.
Eigen::MatrixXd principal_directions(const Eigen::MatrixXd& centres, std::span<const std::uint32_t> classes) {
  const Eigen::Index dims = centres.rows();
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(dims);
  for (const std::uint32_t c : classes) mean += centres.col(c);
  mean /= static_cast<double>(classes.size());
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(dims, dims);
  for (const std::uint32_t c : classes) {
    const Eigen::VectorXd d = centres.col(c) - mean;
    scatter.noalias() += d * d.transpose();
  }
  const Eigen::Index count = std::min(tried_directions, dims);
  Eigen::MatrixXd directions = Eigen::MatrixXd::Identity(dims, count);
  for (int i = 0; i < iterations; ++i) {
    directions = scatter * directions;
    for (Eigen::Index a = 0; a < count; ++a) {
      for (Eigen::Index b = 0; b < a; ++b)
        directions.col(a) -= directions.col(b).dot(directions.col(a)) * directions.col(b);
      const double norm = directions.col(a).norm();
      if (norm < 1e-12 * (1.0 + scatter.trace())) {
        directions.conservativeResize(Eigen::NoChange, a);
        return directions;
      }
      directions.col(a) /= norm;
    }
  }
  return directions;
}

}  // namespace

PatternRejector::PatternRejector(const PatchSet& patches, const RejectorOptions& options)
    : patches_(patches), options_(options) {
  if (!(options.distance > 0.0) || !std::isfinite(options.distance))
    throw std::invalid_argument("the rejection distance " + std::to_string(options.distance) +
                                " is not positive and finite");
  if (options.cells < 2)
    throw std::invalid_argument("a rejector needs at least 2 cells, got " + std::to_string(options.cells));
  centres_.resize(static_cast<Eigen::Index>(patches.dimensions()), static_cast<Eigen::Index>(patches.size()));
  nets_.reserve(patches.size());
  for (std::size_t i = 0; i < patches.size(); ++i) {
    nets_.push_back(patches.bezier(i));
    centres_.col(static_cast<Eigen::Index>(i)) = nets_.back().rowwise().mean();
  }
  std::vector<std::uint32_t> all(patches.size());
  std::iota(all.begin(), all.end(), 0U);
  divide(std::move(all), 0, options.max_growth * static_cast<double>(patches.size()));
  nets_ = {};
  centres_ = {};
}

PatternRejector::Interval PatternRejector::extent(std::uint32_t patch,
                                                  const Eigen::VectorXd& direction) const {
  const Eigen::VectorXd along = nets_[patch].transpose() * direction;
  const bernstein::Range range =
      bernstein::range(patches_.shape(patch), {along.data(), static_cast<std::size_t>(along.size())}, 0);
  const double margin = options_.distance + rounding * (1.0 + std::abs(range.low) + std::abs(range.high));
  return {range.low - margin, range.high + margin};
}

PatternRejector::Division PatternRejector::divide_along(const Eigen::VectorXd& direction,
                                                        std::span<const std::uint32_t> classes) const {
  Division division;
  division.direction = direction;
  std::vector<double> places;
  for (const std::uint32_t c : classes) {
    places.push_back(direction.dot(centres_.col(c)));
    division.extents.push_back(extent(c, direction));
  }
  std::sort(places.begin(), places.end());
  for (std::size_t cell = 1; cell < options_.cells; ++cell) {
    const double cut = places[cell * places.size() / options_.cells];
    if (division.cuts.empty() || cut > division.cuts.back()) division.cuts.push_back(cut);
  }
  // Cells hold about equally many centres: the mean size of the cells' sets is what a point keeps.
  std::size_t reached = 0;
  for (const Interval& e : division.extents) {
    const auto first = std::lower_bound(division.cuts.begin(), division.cuts.end(), e.low);
    const auto last = std::upper_bound(division.cuts.begin(), division.cuts.end(), e.high);
    reached += static_cast<std::size_t>(last - first) + 1;
  }
  division.reached = static_cast<double>(reached);
  division.share = division.reached / static_cast<double>(classes.size() * (division.cuts.size() + 1));
  return division;
}

std::optional<PatternRejector::Division> PatternRejector::best_division(
    std::span<const std::uint32_t> classes, double budget) const {
  const Eigen::MatrixXd directions = principal_directions(centres_, classes);
  std::optional<Division> best;
  for (Eigen::Index d = 0; d < directions.cols(); ++d) {
    Division division = divide_along(directions.col(d), classes);
    if (division.share < (best ? best->share : options_.worthwhile) && division.reached <= budget)
      best = std::move(division);
  }
  return best;
}

std::size_t PatternRejector::add_leaf(std::size_t number, std::span<const std::uint32_t> classes) {
  nodes_[number].first_class = classes_.size();
  nodes_[number].class_count = classes.size();
  classes_.insert(classes_.end(), classes.begin(), classes.end());
  return number;
}

std::size_t PatternRejector::divide(std::vector<std::uint32_t> classes, std::size_t depth, double budget) {
  const std::size_t number = nodes_.size();
  nodes_.emplace_back();
  if (classes.size() <= options_.small_set || depth >= options_.max_depth) return add_leaf(number, classes);
  const std::optional<Division> best = best_division(classes, budget);
  if (!best) return add_leaf(number, classes);

  Node node;
  node.direction = directions_.size();
  directions_.insert(directions_.end(), best->direction.begin(), best->direction.end());
  node.low = best->extents[0].low;
  node.high = best->extents[0].high;
  for (const Interval& e : best->extents) {
    node.low = std::min(node.low, e.low);
    node.high = std::max(node.high, e.high);
  }
  node.first_cut = cuts_.size();
  node.cuts = best->cuts.size();
  cuts_.insert(cuts_.end(), best->cuts.begin(), best->cuts.end());
  node.first_child = children_.size();
  children_.resize(children_.size() + best->cuts.size() + 1);
  nodes_[number] = node;
  for (std::size_t cell = 0; cell <= best->cuts.size(); ++cell) {
    std::vector<std::uint32_t> reaching;
    for (std::size_t i = 0; i < classes.size(); ++i) {
      // A cell is closed: a point on a cut belongs to either side.
      const bool above = cell == 0 || best->extents[i].high >= best->cuts[cell - 1];
      const bool below = cell == best->cuts.size() || best->extents[i].low <= best->cuts[cell];
      if (above && below) reaching.push_back(classes[i]);
    }
    const double part = budget * static_cast<double>(reaching.size()) / best->reached;
    const std::size_t child = divide(std::move(reaching), depth + 1, part);
    children_[node.first_child + cell] = child;
  }
  return number;
}

std::span<const std::uint32_t> PatternRejector::survivors(const double* point) const {
  const std::size_t dims = patches_.dimensions();
  std::size_t number = 0;
  for (;;) {
    const Node& node = nodes_[number];
    if (node.cuts == 0) return std::span(classes_).subspan(node.first_class, node.class_count);
    const double* direction = directions_.data() + node.direction;
    double place = 0.0;
    for (std::size_t k = 0; k < dims; ++k) place += direction[k] * point[k];
    if (place < node.low || place > node.high) return {};
    const double* cuts = cuts_.data() + node.first_cut;
    std::size_t cell = 0;
    while (cell < node.cuts && place > cuts[cell]) ++cell;
    number = children_[node.first_child + cell];
  }
}

std::size_t PatternRejector::memory() const {
  return nodes_.capacity() * sizeof(Node) + (directions_.capacity() + cuts_.capacity()) * sizeof(double) +
         children_.capacity() * sizeof(std::size_t) + classes_.capacity() * sizeof(std::uint32_t);
}

RejectionSearch::RejectionSearch(std::span<const Manifold> manifolds, const RejectorOptions& options)
    : ManifoldSearch(manifolds), patches_(manifolds), rejector_(patches_, options) {}

std::size_t RejectionSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                          std::span<ClosestPoint> results, double bound) const {
  QueryMemory& memory = begin_query(point, patches_.dimensions(), results.size());
  if (results.empty()) return 0;
  BestList best(std::span(memory.slots).first(results.size()), std::min(bound, rejector_.options().distance));
  for (const std::uint32_t patch : rejector_.survivors(memory.point.data())) {
    PatchPoint found;
    if (patches_.closest(patch, memory.point.data(), best.cut(), found)) best.offer(found);
  }
  return finish_query(patches_, best, memory.point.data(), results);
}

}  // namespace eigenpose
