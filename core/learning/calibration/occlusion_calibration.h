#pragma once

/// When a partly covered region is accepted: not by a distance, of which covers take any share, but by what
/// speaks for it more than for strangers.
///
/// Learned views are shown to the model as strangers, each to all objects but its own, as they are and with a
/// fifth hidden; what speaks more for another object counts. A covered region is accepted when the evidence
/// for it exceeds what all but a set share of these strangers reach.

#include <optional>
#include <span>

#include "core/learning/parts_learning.h"

namespace eigenpose {

/// What one learned view showed as a stranger.
struct OcclusionEvidence {
  std::size_t stranger = 0;   ///< the object it shows
  std::size_t taken_for = 0;  ///< the object it was taken for
  double evidence = 0.0;  ///< see PartsIdentification; −∞ where it would not be taken for a covered object
};

struct OcclusionCalibrationOptions {
  std::size_t views = 200;  ///< learned views that are shown, evenly spread
  unsigned threads = 0;
};

/// Shows learned views as strangers. Empty for a model of one object. @throws Interrupted.
std::vector<OcclusionEvidence> measure_occlusion(const PartsModel& model,
                                                 const std::vector<PartsViews>& objects,
                                                 const OcclusionCalibrationOptions& options,
                                                 const Progress& progress = {}, std::stop_token stop = {});

/// The evidence that at most a share `stranger_rate` of them exceeds, and no less than is ever enough; +∞
/// where there are none.
/// @param without this object's views, and what was taken for it, do not count.
double occlusion_threshold(std::span<const OcclusionEvidence> strangers, double stranger_rate,
                           std::optional<std::size_t> without = {});

}  // namespace eigenpose
