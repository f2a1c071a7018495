#pragma once

/// Constants of the decision rule that calibration and evaluation apply as well.

namespace eigenpose {

/// A region that is occluded by more than this share is reported as unknown.
inline constexpr double max_occluded_share = 0.5;

/// Two poses are distinct when they differ by more than this share of a DOF's range.
inline constexpr double poses_apart = 1.0 / 12.0;

}  // namespace eigenpose
