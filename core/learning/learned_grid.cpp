#include "core/learning/learned_grid.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// Values closer than this share of a DOF's range are one commanded position: 0.7° of a turn.
constexpr double play_share = 0.002;

/// Values of one DOF that count as one.
struct Cluster {
  double sum = 0.0;
  std::size_t count = 0;
  [[nodiscard]] double mean() const { return sum / static_cast<double>(count); }
};

struct AxisClusters {
  std::vector<double> samples;       ///< ascending
  std::vector<std::size_t> of_view;  ///< the sample each view belongs to
};

/// Groups sorted values whose distance to the group's first is below `play`.
AxisClusters cluster(const Dof& dof, std::span<const std::vector<double>> poses, std::size_t d, double play) {
  std::vector<std::size_t> by_value(poses.size());
  std::iota(by_value.begin(), by_value.end(), std::size_t{0});
  std::vector<double> values(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    values[i] = dof.canonical(poses[i][d]);
    // Just below the seam belongs to the start of the axis.
    if (dof.periodic && dof.upper - values[i] < play) values[i] -= dof.period();
  }
  std::sort(by_value.begin(), by_value.end(),
            [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  AxisClusters result;
  result.of_view.resize(poses.size());
  std::vector<Cluster> clusters;
  double group_start = 0.0;
  for (const std::size_t i : by_value) {
    if (clusters.empty() || values[i] - group_start > play) {
      clusters.emplace_back();
      group_start = values[i];
    }
    clusters.back().sum += values[i];
    ++clusters.back().count;
    result.of_view[i] = clusters.size() - 1;
  }
  for (const Cluster& c : clusters) result.samples.push_back(c.mean());
  // The group around the seam may have its mean just below the range.
  if (dof.periodic && !result.samples.empty())
    result.samples.front() = std::max(result.samples.front(), dof.lower);
  return result;
}

/// Share of a grid's cells that must be taken for its own values to be the axes.
constexpr double filled_grid = 0.5;
/// Coefficients of a fit over views: below 1, so that the views say more than the penalty.
constexpr double coefficients_per_view = 2.0 / 3.0;
/// Appearance changes faster around a turn than along a DOF that does not close: steps of its range for each
/// step of the other.
constexpr double turn_detail = 4.0;

/// Even steps over the values of each DOF, for poses that are no grid.
std::vector<SampleAxis> even_axes(const std::vector<SampleAxis>& found, std::size_t views) {
  double detail = 1.0;
  std::size_t moving = 0;
  for (const SampleAxis& axis : found) {
    if (axis.samples.size() < 2) continue;
    ++moving;
    if (axis.dof.periodic) detail *= turn_detail;
  }
  const double wanted = coefficients_per_view * static_cast<double>(views) / detail;
  const double steps =
      std::pow(std::max(wanted, 1.0), 1.0 / static_cast<double>(std::max<std::size_t>(moving, 1)));
  std::vector<SampleAxis> axes;
  for (const SampleAxis& axis : found) {
    const auto distinct = static_cast<double>(axis.samples.size());
    if (distinct < 2) {
      axes.push_back(axis);
      continue;
    }
    const bool closed = axis.dof.periodic;
    const double few = closed ? 3.0 : 2.0;
    const auto count = static_cast<int>(
        std::clamp(std::round(steps * (closed ? turn_detail : 1.0)), few, std::max(few, distinct)));
    const double first = closed ? axis.dof.lower : axis.samples.front();
    const double range = closed ? axis.dof.period() : axis.samples.back() - axis.samples.front();
    SampleAxis even{axis.dof, {}};
    for (int i = 0; i < count; ++i) even.samples.push_back(first + range * i / (closed ? count : count - 1));
    axes.push_back(std::move(even));
  }
  return axes;
}

/// Refuses what no manifold goes through, before anything is learned from it.
void check_fit(const LearnedGrid& grid, const std::string& object) {
  try {
    (void)Manifold::fit(grid.axes, grid.poses, Eigen::MatrixXd::Zero(1, grid.poses.cols()));
  } catch (const std::invalid_argument& wrong) {
    throw Error("\"" + object + "\": " + wrong.what());
  }
}

}  // namespace

std::string pose_text(const Workspace& workspace, std::span<const double> pose) {
  std::ostringstream text;
  for (std::size_t d = 0; d < workspace.size(); ++d)
    text << (d > 0 ? ", " : "") << workspace[d].name << " " << pose[d] << " " << workspace[d].unit;
  return text.str();
}

LearnedGrid find_learned_grid(const Workspace& workspace, std::span<const std::vector<double>> poses,
                              const std::string& object) {
  LearnedGrid grid;
  std::vector<std::vector<std::size_t>> cell_of_view(poses.size());
  double cells = 1.0;
  for (std::size_t d = 0; d < workspace.size(); ++d) {
    const Dof& dof = workspace[d];
    const double step = dof.period() / static_cast<double>(poses.size());
    // With one DOF every view has a pose of its own; with several, the step is not below range / views
    // either.
    const double play = std::min(play_share * dof.period(), 0.25 * step * (workspace.size() > 1 ? 4.0 : 1.0));
    AxisClusters axis = cluster(dof, poses, d, play);
    const std::size_t n = axis.samples.size();
    if (dof.periodic && n == 2)
      throw Error("\"" + object + "\": views at only 2 values of " + dof.name + "; a turn needs at least 3");
    for (std::size_t i = 0; i < poses.size(); ++i) cell_of_view[i].push_back(axis.of_view[i]);
    cells *= static_cast<double>(n);
    grid.axes.push_back({dof, std::move(axis.samples)});
  }
  // The first view in each cell that has one, by cell.
  std::map<std::vector<std::size_t>, std::size_t> taken;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto [place, fresh] = taken.emplace(cell_of_view[i], i);
    if (!fresh) grid.doubled.push_back({i, place->second});
  }
  if (taken.size() < 2)
    throw Error("\"" + object + "\": " + std::to_string(taken.size()) +
                " different pose(s) make no manifold; at least 2 are needed");
  for (const auto& [cell, view] : taken) grid.order.push_back(view);
  if (static_cast<double>(taken.size()) == cells) return grid;
  grid.poses.resize(static_cast<Eigen::Index>(workspace.size()), static_cast<Eigen::Index>(taken.size()));
  for (std::size_t i = 0; i < grid.order.size(); ++i)
    for (std::size_t d = 0; d < workspace.size(); ++d)
      grid.poses(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(i)) =
          workspace[d].canonical(poses[grid.order[i]][d]);
  if (static_cast<double>(taken.size()) < filled_grid * cells) grid.axes = even_axes(grid.axes, taken.size());
  check_fit(grid, object);
  return grid;
}

}  // namespace eigenpose
