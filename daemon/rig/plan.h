#pragma once

/// A plan: the grid of poses an acquisition visits, and the rules it must keep.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/workspace.h"

namespace eigenpose {

/// Most views of a plan: more than fifty turns of a thousand views each is a typing error.
inline constexpr std::size_t max_plan_views = 100'000;

/// Evenly spaced positions, in the axis's unit.
struct Spacing {
  double from = 0.0;
  double to = 0.0;
  int count = 0;
};

/// What is asked of one axis: its positions, or how they are spaced.
struct PlanAxisRequest {
  std::string axis;
  std::vector<double> positions;   ///< in the axis's unit, in the order they are visited
  std::optional<Spacing> spacing;  ///< in place of `positions`
};

/// A plan as a person writes it, not checked yet.
struct PlanRequest {
  std::string name;
  std::vector<PlanAxisRequest> axes;
};

/// The positions of one axis, in its unit, in the order they are visited.
struct PlanAxis {
  std::string axis;
  std::vector<double> positions;
};

/// Every combination of the axes' positions; the last axis runs fastest. Value type. `make_plan` makes one
/// that the axes can follow.
struct Plan {
  std::string name;
  std::vector<PlanAxis> axes;

  [[nodiscard]] std::size_t size() const;  ///< number of views
  /// Position of every axis at grid point i, in the order of `axes`. @pre i < size().
  [[nodiscard]] std::vector<double> at(std::size_t i) const;
};

/// The plan that is asked for, checked against the axes there are. Sizes are checked before any position is
/// computed. @throws ConfigError naming the plan and what is allowed: no axis, an unknown axis, an axis
/// twice, no or too many positions, both positions and a spacing, a position outside the range or twice, more
/// than `max_plan_views` views.
Plan make_plan(const PlanRequest& request, std::span<const Dof> dofs);

/// `spacing.count` evenly spaced positions. The end is included, except on a full turn of a periodic axis,
/// where it is the beginning again. @throws ConfigError for a count outside 1…max_plan_views, an empty or an
/// infinite range.
std::vector<double> spaced_positions(const Dof& dof, const Spacing& spacing);

/// The workspace of the plan's axes, in the plan's order. @pre `make_plan` made the plan for these DOFs.
Workspace plan_workspace(const Plan& plan, std::span<const Dof> dofs);

}  // namespace eigenpose
