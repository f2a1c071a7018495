#include "core/learning/calibration/thinned_manifolds.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/statistics.h"
#include "core/manifold/sample_grid.h"

namespace eigenpose {
namespace {

/// Growth of the squared interpolation error when the step doubles, where it cannot be measured; and the
/// bounds of a measured growth: an error of the first power of the step gives at least 2, of the third
/// power 64.
constexpr double default_growth = 4.0;
constexpr double least_growth = 2.0;
constexpr double most_growth = 64.0;

/// Every n-th view of those that are no grid, in the order of their poses, but not `from`: each of its
/// neighbours is n/2 views away.
std::vector<Eigen::Index> thinned_views(std::size_t count, std::size_t every, std::size_t from) {
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < count; ++i)
    if ((i + every - from % every) % every == every / 2) kept.push_back(static_cast<Eigen::Index>(i));
  return kept;
}

/// Of few views only the one is left out.
bool too_few_to_thin(std::size_t values) {
  return values < 6;
}

}  // namespace

ThinnedManifolds::Thinned ThinnedManifolds::thin_scattered(std::size_t every, std::size_t from) const {
  const std::vector<Eigen::Index> kept = thinned_views(object_.count, every, from);
  const Eigen::MatrixXd poses = object_.poses(Eigen::all, kept);
  if (kept.size() < 3 || !Manifold::undetermined_dof(object_.axes, poses).empty()) return {};
  Thinned result;
  result.manifold = std::make_unique<Manifold>(
      Manifold::fit(object_.axes, poses, points_(Eigen::all, kept), {.degree = degree_}));
  result.search = make_search("tree", {result.manifold.get(), 1});
  return result;
}

ThinnedManifolds::Thinned ThinnedManifolds::thin(std::size_t d, std::size_t every, std::size_t from) const {
  const std::vector<double>& all = object_.axes[d].samples;
  const bool closed = object_.axes[d].dof.periodic;
  const auto kept = [&](std::size_t i) {
    // The ends of an open DOF stay: beyond them there is no manifold.
    if (!closed && (i == 0 || i + 1 == all.size())) return true;
    return too_few_to_thin(all.size()) ? i != from : (i + every - from) % every == every / 2;
  };
  std::vector<SampleAxis> axes = object_.axes;
  axes[d].samples.clear();
  for (std::size_t i = 0; i < all.size(); ++i)
    if (kept(i)) axes[d].samples.push_back(all[i]);
  if (axes[d].samples.size() < (closed ? 3U : 2U)) return {};  // they would make no manifold
  const Grid grid = grid_of(object_.axes);
  std::vector<Eigen::Index> cells;
  for (std::size_t cell = 0; cell < object_.count; ++cell)
    if (kept(grid.index(cell, d))) cells.push_back(static_cast<Eigen::Index>(cell));
  Thinned result;
  result.manifold =
      std::make_unique<Manifold>(Manifold::interpolate(axes, points_(Eigen::all, cells), degree_));
  result.search = make_search("tree", {result.manifold.get(), 1});
  return result;
}

std::optional<double> ThinnedManifolds::squared_distance(std::size_t d, std::size_t every, std::size_t from,
                                                         const Eigen::VectorXf& point) {
  const bool scattered = object_.poses.size() > 0;
  const std::size_t values = scattered ? object_.count : object_.axes[d].samples.size();
  if (values < 3 || (every > 2 && values < 3 * every)) return std::nullopt;
  if (!scattered && !object_.axes[d].dof.periodic && (from == 0 || from + 1 == values)) return std::nullopt;
  // Values a whole number of thinned steps apart leave the same views.
  if (scattered || !too_few_to_thin(values)) from %= every;
  const std::array<std::size_t, 3> key{d, every, from};
  auto made = made_.find(key);
  if (made == made_.end())
    made = made_.emplace(key, scattered ? thin_scattered(every, from) : thin(d, every, from)).first;
  if (!made->second.search) return std::nullopt;
  std::array<ClosestPoint, 1> nearest;
  if (made->second.search->nearest_into(point, nearest) == 0) return std::nullopt;
  return nearest[0].distance * nearest[0].distance;
}

MissedErrors missed_at(ThinnedManifolds& thinned, const Grid& grid, std::size_t view,
                       const Eigen::VectorXf& point, double full) {
  MissedErrors missed{};
  for (std::size_t t = 0; t < thinnings.size(); ++t)
    for (std::size_t d = 0; d < grid.axes() && missed[t] >= 0.0; ++d) {
      const auto squared = thinned.squared_distance(d, thinnings[t], grid.index(view, d), point);
      missed[t] = squared ? missed[t] + std::max(0.0, *squared - full) : -1.0;
    }
  return missed;
}

double error_growth(std::span<const MissedErrors> views) {
  std::array<double, thinnings.size() - 1> growth{};
  for (std::size_t t = 0; t < growth.size(); ++t) {
    std::vector<double> fine;
    std::vector<double> coarse;
    for (const MissedErrors& missed : views)
      if (missed[t] >= 0.0 && missed[t + 1] >= 0.0) {
        fine.push_back(missed[t]);
        coarse.push_back(missed[t + 1]);
      }
    if (fine.empty()) continue;
    growth[t] =
        std::clamp(upper_median(coarse) / std::max(upper_median(fine), 1e-12), least_growth, most_growth);
  }
  if (growth[0] == 0.0) return default_growth;
  // Coarse steps miss so much that doubling them hardly adds: growth itself grows towards finer ones.
  const double next = growth[1] == 0.0 ? growth[0] : growth[0] * growth[0] / growth[1];
  return std::clamp(next, growth[0], most_growth);
}

}  // namespace eigenpose
