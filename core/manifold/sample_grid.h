#pragma once

/// The grid of a manifold's samples.

#include <span>
#include <utility>
#include <vector>

#include "core/base/grid.h"
#include "core/manifold/axis_basis.h"

namespace eigenpose {

/// One point for each combination of the axes' samples, last axis fastest: the order of
/// Manifold::interpolate.
inline Grid grid_of(std::span<const SampleAxis> axes) {
  std::vector<std::size_t> counts;
  counts.reserve(axes.size());
  for (const SampleAxis& axis : axes) counts.push_back(axis.samples.size());
  return Grid(std::move(counts));
}

/// Whether an axis ends, or goes on round its seam.
inline Grid::Ends ends_of(const SampleAxis& axis) {
  return axis.dof.periodic ? Grid::Ends::closed : Grid::Ends::open;
}

}  // namespace eigenpose
