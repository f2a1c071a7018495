#pragma once

/// Rejection thresholds from the learned views alone.
///
/// Each learned view is perturbed by the residual misalignment and matched three times: against all views of
/// its object, without its neighbours within one grid step, and without those within two. A new view is at
/// most half a step from a learned one: its score is read off the power law s(d) = s₀ + c·dᵖ through the
/// three. Scores are standardised for each object, and pooled. The threshold is conformal (Vovk, Gammerman,
/// Shafer 2005): with n scores, the k-th largest bounds the rate of false rejections by k/(n + 1), as far as
/// the power law holds; the smallest rate that n views can support is 1/(n + 1).

#include "core/learning/calibration/perturbation.h"
#include "core/learning/parts_learning.h"

namespace eigenpose {

struct PartsCalibrationOptions {
  double rate = 0.001;  ///< of false rejections: share of known regions that may be rejected; 0…0.5
  /// The misalignment that alignment leaves.
  Perturbation residual{.shift = 0.5 / 64.0, .scale = 0.01, .turn_deg = 1.0};
  unsigned threads = 0;
};

/// Fills `model.calibration` and `model.smallest_rate`. @param objects what the model was learned from.
/// @throws std::invalid_argument for a rate out of range; Interrupted.
void calibrate_parts(PartsModel& model, const std::vector<PartsViews>& objects,
                     const PartsCalibrationOptions& options, const Progress& progress = {},
                     std::stop_token stop = {});

}  // namespace eigenpose
