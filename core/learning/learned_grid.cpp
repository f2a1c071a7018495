#include "core/learning/learned_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "core/base/error.h"

namespace eigenpose {
namespace {

constexpr double play_share = 0.002;  ///< of a DOF's range: 0.7° of a turn

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

std::string name_pose(const Workspace& workspace, const std::vector<SampleAxis>& axes, std::size_t cell) {
  std::vector<std::size_t> at(axes.size());
  for (std::size_t d = axes.size(); d-- > 0;) {
    at[d] = cell % axes[d].samples.size();
    cell /= axes[d].samples.size();
  }
  std::ostringstream text;
  for (std::size_t d = 0; d < axes.size(); ++d)
    text << (d > 0 ? ", " : "") << workspace[d].name << " " << axes[d].samples[at[d]] << " "
         << workspace[d].unit;
  return text.str();
}

}  // namespace

LearnedGrid find_learned_grid(const Workspace& workspace, std::span<const std::vector<double>> poses,
                              const std::string& object) {
  LearnedGrid grid;
  std::vector<std::size_t> cell_of_view(poses.size(), 0);
  std::size_t cells = 1;
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
    for (std::size_t i = 0; i < poses.size(); ++i) cell_of_view[i] = cell_of_view[i] * n + axis.of_view[i];
    cells *= n;
    grid.axes.push_back({dof, std::move(axis.samples)});
  }
  constexpr auto nobody = static_cast<std::size_t>(-1);
  grid.order.assign(cells, nobody);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    auto& place = grid.order[cell_of_view[i]];
    if (place != nobody)
      throw Error("\"" + object + "\" has two views at " + name_pose(workspace, grid.axes, cell_of_view[i]) +
                  "; remove one of them");
    place = i;
  }
  const auto gap = std::find(grid.order.begin(), grid.order.end(), nobody);
  if (gap != grid.order.end())
    throw Error("\"" + object + "\" has " + std::to_string(poses.size()) + " views for a grid of " +
                std::to_string(cells) + " poses; there is none at " +
                name_pose(workspace, grid.axes, static_cast<std::size_t>(gap - grid.order.begin())) +
                "; acquire it to its end");
  return grid;
}

}  // namespace eigenpose
