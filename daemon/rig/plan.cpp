#include "daemon/rig/plan.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

const Dof* find_dof(std::span<const Dof> dofs, const std::string& name) {
  const auto found = std::find_if(dofs.begin(), dofs.end(), [&](const Dof& dof) { return dof.name == name; });
  return found == dofs.end() ? nullptr : &*found;
}

std::string names_of(std::span<const Dof> dofs) {
  std::vector<std::string> names;
  for (const Dof& dof : dofs) names.push_back(dof.name);
  return names.empty() ? "none, the configuration has no [[axis]]"
                       : fmt::format("{}", fmt::join(names, ", "));
}

[[noreturn]] void refuse(const PlanRequest& request, const std::string& what) {
  throw ConfigError(fmt::format("plan \"{}\": {}", request.name, what));
}

/// Axes and number of views, before a single position is computed.
void check_shape(const PlanRequest& request, std::span<const Dof> dofs) {
  if (request.axes.empty()) refuse(request, "it names no axis: at least one is needed");
  std::set<std::string> seen;
  std::size_t views = 1;
  for (const PlanAxisRequest& axis : request.axes) {
    if (find_dof(dofs, axis.axis) == nullptr)
      refuse(request, fmt::format("there is no axis \"{}\"; allowed: {}", axis.axis, names_of(dofs)));
    if (!seen.insert(axis.axis).second) refuse(request, fmt::format("axis \"{}\" is named twice", axis.axis));
    if (axis.spacing && !axis.positions.empty())
      refuse(request, fmt::format("axis \"{}\" has positions and a spacing: give one of them", axis.axis));
    if (!axis.spacing && axis.positions.empty())
      refuse(request, fmt::format("axis \"{}\" has no positions", axis.axis));
    views *=
        axis.spacing ? static_cast<std::size_t>(std::max(1, axis.spacing->count)) : axis.positions.size();
    if (views > max_plan_views)
      refuse(request, fmt::format("its grid has more than {} views: take fewer positions", max_plan_views));
  }
}

void check_positions(const PlanRequest& request, const PlanAxis& axis, const Dof& dof) {
  std::set<double> positions;
  for (const double position : axis.positions) {
    if (!std::isfinite(position) || position < dof.lower || position > dof.upper)
      refuse(request, fmt::format("axis \"{}\" cannot reach {} {}; allowed: {} to {}", axis.axis, position,
                                  dof.unit, dof.lower, dof.upper));
    if (!positions.insert(dof.canonical(position)).second)
      refuse(request, fmt::format("axis \"{}\" visits {} {} twice", axis.axis, position, dof.unit));
  }
}

}  // namespace

std::size_t Plan::size() const {
  std::size_t product = axes.empty() ? 0 : 1;
  for (const PlanAxis& axis : axes) product *= axis.positions.size();
  return product;
}

std::vector<double> Plan::at(std::size_t i) const {
  std::vector<double> q(axes.size());
  for (std::size_t a = axes.size(); a-- > 0;) {
    const std::vector<double>& positions = axes[a].positions;
    q[a] = positions[i % positions.size()];
    i /= positions.size();
  }
  return q;
}

std::vector<double> spaced_positions(const Dof& dof, const Spacing& spacing) {
  const auto [from, to, count] = spacing;
  if (count < 1 || static_cast<std::size_t>(count) > max_plan_views)
    throw ConfigError(
        fmt::format("axis \"{}\": a count of {}; allowed: 1 to {}", dof.name, count, max_plan_views));
  if (!std::isfinite(from) || !std::isfinite(to) || (count > 1 && from == to))
    throw ConfigError(fmt::format("axis \"{}\": {} positions from {} to {}: the range is empty or infinite",
                                  dof.name, count, from, to));
  const bool full_turn = dof.periodic && std::abs(std::abs(to - from) - dof.period()) < 1e-9 * dof.period();
  const int steps = full_turn ? count : std::max(1, count - 1);
  std::vector<double> positions(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    positions[static_cast<std::size_t>(i)] = dof.canonical(from + (to - from) * i / steps);
  return positions;
}

Plan make_plan(const PlanRequest& request, std::span<const Dof> dofs) {
  check_shape(request, dofs);
  Plan plan{request.name, {}};
  for (const PlanAxisRequest& asked : request.axes) {
    const Dof& dof = *find_dof(dofs, asked.axis);
    PlanAxis axis{asked.axis, asked.positions};
    if (asked.spacing) axis.positions = spaced_positions(dof, *asked.spacing);
    check_positions(request, axis, dof);
    plan.axes.push_back(std::move(axis));
  }
  return plan;
}

Workspace plan_workspace(const Plan& plan, std::span<const Dof> dofs) {
  std::vector<Dof> chosen;
  for (const PlanAxis& axis : plan.axes) chosen.push_back(*find_dof(dofs, axis.axis));
  return Workspace(std::move(chosen));
}

}  // namespace eigenpose
