#pragma once

/// Learning what partial matching and alignment need, from normalised views.

#include <functional>
#include <stop_token>
#include <vector>

#include <opencv2/core.hpp>

#include "core/base/progress.h"
#include "core/manifold/manifold.h"
#include "core/model/parts_model.h"

namespace eigenpose {

/// The views of one object: square 8-bit pictures in the order of its grid (last axis fastest).
struct PartsViews {
  std::vector<SampleAxis> axes;
  std::size_t count = 0;
  std::function<cv::Mat(std::size_t)> view;  ///< called from several threads
  Eigen::MatrixXd poses = {};                ///< as ObjectViews::poses
  /// Its alignment eigenspace where these views were learned before; else null. Outlives the call.
  const AlignmentEigenspace* alignment = nullptr;
  std::vector<double> left_out_errors = {};  ///< of that eigenspace
};

struct PartsLearningOptions {
  /// Where views are farther apart than this share of a turn (20°), foreshortened and mirrored copies of them
  /// are learned, too.
  double sparse_step = 20.0 / 360.0;
  unsigned threads = 0;
};

/// Learns windows and alignment eigenspaces. What is calibrated comes later (calibration/).
/// @throws std::invalid_argument without objects or views; Interrupted.
PartsModel learn_parts(const std::vector<PartsViews>& objects, const PartsLearningOptions& options,
                       const Progress& progress = {}, const std::stop_token& stop = {});

}  // namespace eigenpose
