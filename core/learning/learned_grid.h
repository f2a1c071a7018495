#pragma once

/// Sorting views by pose, for a manifold through them.
///
/// Views that fill a grid of poses are interpolated (Manifold::interpolate); any other poses are fitted
/// (Manifold::fit). One DOF always is a grid: its samples may be as uneven as they are.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/workspace.h"
#include "core/manifold/manifold.h"

namespace eigenpose {

/// A view at the pose of another.
struct DoubledView {
  std::size_t view = 0;
  std::size_t same_as = 0;  ///< the first view at this pose
};

/// Views in the order of their poses.
struct LearnedGrid {
  /// Where the coefficients of the manifold stand: the poses of the grid, or, where the poses are no grid and
  /// fill less than half of the one they span, even steps.
  std::vector<SampleAxis> axes;
  /// order[i] is the i-th view; of a grid, the one in cell i, the last axis running fastest.
  std::vector<std::size_t> order;
  Eigen::MatrixXd poses;             ///< m × views, column i of view order[i]; 0 × 0 for a full grid
  std::vector<DoubledView> doubled;  ///< views that stand in no order: their pose is taken
};

/// Finds the grid that `poses` fill, or the axes of a fit through them. Values of a DOF that differ by less
/// than the play of a drive (0.2 % of its range, at most a quarter of the step) count as one, at their mean.
/// @param object for errors only.
/// @throws Error naming the object and the DOF when the poses are too few for a manifold, or do not determine
/// one: less than two different poses, two values of a periodic DOF, DOFs that only change together.
LearnedGrid find_learned_grid(const Workspace& workspace, std::span<const std::vector<double>> poses,
                              const std::string& object);

/// "table 90 deg, light 30 deg".
std::string pose_text(const Workspace& workspace, std::span<const double> pose);

}  // namespace eigenpose
