#pragma once

/// Outcomes as JSON, the same wherever they are told.

#include <nlohmann/json_fwd.hpp>

#include "core/model/model.h"
#include "core/recognition/outcome.h"

namespace eigenpose::cli {

/// One outcome: verdict, box, object, q, pose (values by name and unit), q_sigma (null where it cannot be
/// seen), distance, rejection_distance, covered_share, confidence, runner_up, other_pose.
nlohmann::json to_json(const Outcome& outcome, const Model& model);

}  // namespace eigenpose::cli
