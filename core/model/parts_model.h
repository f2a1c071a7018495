#pragma once

/// What is learned for partial matching and for alignment: the windows and the pose space of every object.

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "core/alignment/alignment_eigenspace.h"
#include "core/windows/partial_match.h"
#include "core/windows/windows.h"

namespace eigenpose {

/// What an object's own views say of how well it is matched.
struct PartsCalibration {
  /// A whole region farther from the manifold after alignment, in the universal eigenspace, is unknown: see
  /// calibrate_match.
  double rejection_distance = 0.0;
  double sure_distance = 0.0;     ///< beyond it, windows must agree that it is the object
  double typical_distance = 0.0;  ///< root mean square of new views of the object
  /// A score is the share of window votes that the best pose does not get: 0 is perfect, 1 nothing in common;
  /// see calibrate_parts.
  double rejection_score = 1.0;  ///< a region with a larger score is unknown
  double typical_score = 0.1;    ///< mean score of the object's own views
  double covered_share = 0.1;    ///< a region with a larger share of foreign windows is taken as covered
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

  /// The whole region settles which object it is when its squared distance is below this times that of the
  /// nearest other object: see calibrate_match.
  double sure_ratio = 0.3;
  /// A covered region with less evidence is unknown: see covered_calibration.h.
  double covered_evidence = std::numeric_limits<double>::infinity();
  /// The smallest rate of wrong rejections that the number of learned views can support, 1/(n + 1).
  double smallest_rate = 1.0;

  /// Bytes held for one object.
  [[nodiscard]] std::size_t memory(std::size_t object) const {
    return objects[object].store.memory() + poses[object].memory();
  }
};

}  // namespace eigenpose
