#pragma once

/// Learning the eigenspace of each object alone.

#include <span>
#include <stop_token>
#include <vector>

#include "core/base/progress.h"
#include "core/learning/calibration/observability.h"
#include "core/learning/training_views.h"
#include "core/model/object_eigenspace.h"

namespace eigenpose {

/// One space an object of `views`. Where left-out views are found better than in the universal eigenspace
/// (mean |error| of the first DOF, from `evidence`), the space is marked for pose.
std::vector<ObjectEigenspace> learn_object_eigenspaces(const TrainingViews& views,
                                                       std::span<const PoseEvidence> evidence, int degree,
                                                       unsigned threads, const Progress& progress,
                                                       std::stop_token stop);

}  // namespace eigenpose
