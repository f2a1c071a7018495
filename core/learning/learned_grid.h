#pragma once

/// Sorting views into the grid of poses that a tensor-product manifold needs.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/base/workspace.h"
#include "core/manifold/manifold.h"

namespace eigenpose {

/// Views in a grid.
struct LearnedGrid {
  std::vector<SampleAxis> axes;
  /// order[cell] is the view that stands there; the last axis runs fastest.
  std::vector<std::size_t> order;
};

/// Finds the grid that `poses` fill. Values of a DOF that differ by less than the play of a drive (0.2 % of
/// its range, at most a quarter of the step) count as one, at their mean.
/// @param object for errors only.
/// @throws Error when a cell is empty or taken twice, or a periodic DOF has two values only: the text names
/// them.
LearnedGrid find_learned_grid(const Workspace& workspace, std::span<const std::vector<double>> poses,
                              const std::string& object);

}  // namespace eigenpose
