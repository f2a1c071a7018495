#include "config/plan.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// Fifty thousand full turns of a patient table; more is a typing error.
constexpr std::size_t max_views = 100'000;

const Dof* find_dof(std::span<const Dof> dofs, const std::string& name) {
  const auto found = std::find_if(dofs.begin(), dofs.end(), [&](const Dof& dof) { return dof.name == name; });
  return found == dofs.end() ? nullptr : &*found;
}

}  // namespace

std::size_t Plan::size() const {
  std::size_t product = axes.empty() ? 0 : 1;
  for (const PlanAxis& axis : axes) {
    if (axis.positions.empty()) return 0;
    // Saturates: a product beyond the limit is refused, it must not wrap round to a small one.
    if (product > max_views) return product;
    product *= axis.positions.size();
  }
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

std::vector<double> spaced_positions(const Dof& dof, double from, double to, int count) {
  if (count < 1)
    throw ConfigError(fmt::format("axis \"{}\": a count of {}: at least 1 is needed", dof.name, count));
  if (static_cast<std::size_t>(count) > max_views)
    throw ConfigError(
        fmt::format("axis \"{}\": a count of {}: at most {} is allowed", dof.name, count, max_views));
  if (count > 1 && from == to)
    throw ConfigError(fmt::format("axis \"{}\": {} positions from {} to {}: the range is empty", dof.name,
                                  count, from, to));
  const bool full_turn = dof.periodic && std::abs(std::abs(to - from) - dof.period()) < 1e-9 * dof.period();
  const int steps = full_turn ? count : std::max(1, count - 1);
  std::vector<double> positions(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    positions[static_cast<std::size_t>(i)] = dof.canonical(from + (to - from) * i / steps);
  return positions;
}

void check_plan(const Plan& plan, std::span<const Dof> dofs) {
  const auto refuse = [&](const std::string& what) {
    throw ConfigError(fmt::format("plan \"{}\": {}", plan.name, what));
  };
  if (plan.axes.empty()) refuse("it names no axis: at least one is needed");
  std::set<std::string> seen;
  for (const PlanAxis& axis : plan.axes) {
    const Dof* dof = find_dof(dofs, axis.axis);
    if (dof == nullptr) {
      std::vector<std::string> names;
      for (const Dof& known : dofs) names.push_back(known.name);
      refuse(fmt::format("there is no axis \"{}\"; allowed: {}", axis.axis,
                         names.empty() ? "none, the configuration has no [[axis]]"
                                       : fmt::format("{}", fmt::join(names, ", "))));
    }
    if (!seen.insert(axis.axis).second) refuse(fmt::format("axis \"{}\" is named twice", axis.axis));
    if (axis.positions.empty()) refuse(fmt::format("axis \"{}\" has no positions", axis.axis));
    std::set<double> positions;
    for (const double position : axis.positions) {
      if (!std::isfinite(position) || position < dof->lower || position > dof->upper)
        refuse(fmt::format("axis \"{}\" cannot reach {} {}; allowed: {} to {}", axis.axis, position,
                           dof->unit, dof->lower, dof->upper));
      if (!positions.insert(dof->canonical(position)).second)
        refuse(fmt::format("axis \"{}\" visits {} {} twice", axis.axis, position, dof->unit));
    }
  }
  if (plan.size() > max_views)
    refuse(fmt::format("its grid has more than {} views: take fewer positions", max_views));
}

Workspace plan_workspace(const Plan& plan, std::span<const Dof> dofs) {
  std::vector<Dof> chosen;
  for (const PlanAxis& axis : plan.axes) chosen.push_back(*find_dof(dofs, axis.axis));
  return Workspace(std::move(chosen));
}

}  // namespace eigenpose
