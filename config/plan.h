#pragma once

/// A plan: the grid of poses an acquisition visits.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/base/workspace.h"

namespace eigenpose {

/// The positions of one axis, in its unit, in the order they are visited.
struct PlanAxis {
  std::string axis;
  std::vector<double> positions;
};

/// Every combination of the axes' positions; the last axis runs fastest. Value type.
struct Plan {
  std::string name;
  std::vector<PlanAxis> axes;

  [[nodiscard]] std::size_t size() const;  ///< number of views
  /// Position of every axis at grid point i, in the order of `axes`. @pre i < size().
  [[nodiscard]] std::vector<double> at(std::size_t i) const;
};

/// `count` evenly spaced positions from `from` to `to`. The end is included, except on a full turn of a
/// periodic axis, where it is the beginning again. @throws ConfigError for a count below 1 or an empty range.
std::vector<double> spaced_positions(const Dof& dof, double from, double to, int count);

/// Checks a plan against the axes there are. @throws ConfigError naming the plan and what is allowed: no
/// axis, unknown axis, an axis twice, a position outside the range or twice, more than 100 000 views.
void check_plan(const Plan& plan, std::span<const Dof> dofs);

/// The workspace of the plan's axes, in the plan's order. @pre the plan has been checked.
Workspace plan_workspace(const Plan& plan, std::span<const Dof> dofs);

}  // namespace eigenpose
