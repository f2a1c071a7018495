#pragma once

/// What is learned for partial matching and for alignment: the windows and the pose space of every object.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "core/alignment/alignment_eigenspace.h"
#include "core/color/color_views.h"
#include "core/windows/partial_match.h"
#include "core/windows/windows.h"

namespace eigenpose {

/// What an object's own views say of how well its windows and its colours match.
struct PartsCalibration {
  double typical_votes = 0.5;  ///< share of the windows' weight that a new view of the object gets, mean
  double foreign_share = 0.1;  ///< a region with a larger share of foreign windows may be occluded
  double typical_color = 0.0;  ///< distance of the colours of a new view, mean; 0 of grey views
};

/// Everything partial matching and alignment know. Immutable once learned; share it between threads.
struct PartsModel {
  int bands = 1;
  std::array<float, 3> background{};  ///< root brightness, see OrientationGridMaker
  WindowSpace space;
  WindowScale scale;
  VotingOptions voting;
  double noise = 1e-4;  ///< ν of the alignment: error variance that the splines leave
  std::vector<PartsObject> objects;
  std::vector<AlignmentEigenspace> poses;     ///< one an object
  std::vector<PartsCalibration> calibration;  ///< one an object
  /// For each object the pose of each learned view, m × views.
  std::vector<Eigen::MatrixXd> view_poses;
  /// For each object the size of the region that each learned view was cut out of, pixels: zero for the views
  /// of an object that came ready-cut; nothing at all where all objects did. Separates objects that touch, as
  /// long as the camera stays where it was.
  std::vector<std::vector<cv::Size>> extents;
  std::vector<ColorViews> colors;  ///< one an object; nothing at all where views are grey

  /// Bytes held for one object.
  [[nodiscard]] std::size_t memory(std::size_t object) const {
    return objects[object].store.memory() + poses[object].memory() +
           (colors.empty() ? 0 : colors[object].memory());
  }
};

}  // namespace eigenpose
