#pragma once

/// Alignment on trusted pixels only, for objects that are partly covered (gappy projection).
///
/// Under a cover the energy of a region is wrong, and so are its projections. Here the manifold's point is
/// compared with the region pixel by pixel, weighted by how far each pixel is trusted, with gain and
/// misalignment as free unknowns.

#include <vector>

#include "core/parts/alignment.h"

namespace eigenpose {

/// Follows the pose from `start` on the coarse scale. @param weights 32×32 numbers 0…1.
/// @param reach how far the pose may move, as a share of each DOF's range.
AlignedPose align_masked(const PosePicture& picture, const PoseSpace& space, const AlignmentOptions& options,
                         const std::vector<float>& weights, const std::vector<double>& start, double reach);

}  // namespace eigenpose
