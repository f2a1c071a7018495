#pragma once

/// The evidence from which a partly occluded region is accepted.
///
/// An occluder can raise the distance arbitrarily. Occluded regions are therefore accepted by evidence (see
/// parts_recognizer.h), compared with that of learned views shown as unknown objects: each view is shown to
/// all objects but its own, as it is and with a fifth hidden, and the larger evidence for a wrong object
/// counts. The threshold is conformal: a region is accepted when its evidence exceeds that of all but a set
/// share of these.

#include <optional>
#include <span>

#include "core/learning/parts_learning.h"

namespace eigenpose {

/// What one learned view showed as an unknown object.
struct OcclusionEvidence {
  std::size_t object = 0;     ///< the object it shows
  std::size_t taken_for = 0;  ///< the object it was taken for
  double evidence = 0.0;      ///< see parts_recognizer.h; −∞ where it would not be accepted as occluded
};

struct OcclusionCalibrationOptions {
  std::size_t views = 200;  ///< learned views that are shown, evenly spread
  unsigned threads = 0;
};

/// Shows learned views as unknown objects. Empty for a model of one object. @throws Interrupted.
std::vector<OcclusionEvidence> measure_occlusion(const PartsModel& model,
                                                 const std::vector<PartsViews>& objects,
                                                 const OcclusionCalibrationOptions& options,
                                                 const Progress& progress = {}, std::stop_token stop = {});

/// The evidence that a new unknown view exceeds with probability `false_acceptance_rate` at most, and at
/// least the smallest value that is ever enough; +∞ without evidence. @param without an object whose views,
/// and what was taken for it, do not count.
double occlusion_threshold(std::span<const OcclusionEvidence> unknown, double false_acceptance_rate,
                           std::optional<std::size_t> without = {});

}  // namespace eigenpose
