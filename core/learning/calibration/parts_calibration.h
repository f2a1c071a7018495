#pragma once

/// Rejection thresholds from the learned views alone.
///
/// Every learned view, moved by what alignment leaves over, is matched with all views of its object, with
/// those at least one step away, and two. A new view is at most half a step from a learned one: its score is
/// read off the power law through the three. Scores are standardised for each object, and pooled. The
/// threshold is conformal: with n scores, the k-th largest bounds the rate of wrong rejections by k/(n + 1),
/// as far as the power law holds; the smallest rate that n views can support is 1/(n + 1).

#include "core/learning/parts_learning.h"

namespace eigenpose {

struct PartsCalibrationOptions {
  double rate = 0.001;        ///< share of known regions that may be rejected; 0…0.5
  double shift = 0.5 / 64.0;  ///< what alignment leaves, of the side of the picture, each way
  double scale = 0.01;        ///< each way
  double turn_deg = 1.0;      ///< each way
  unsigned threads = 0;
};

/// Fills `model.calibration` and `model.smallest_rate`. @param objects what the model was learned from.
/// @throws std::invalid_argument for a rate out of range; Interrupted.
void calibrate_parts(PartsModel& model, const std::vector<PartsViews>& objects,
                     const PartsCalibrationOptions& options, const Progress& progress = {},
                     std::stop_token stop = {});

}  // namespace eigenpose
