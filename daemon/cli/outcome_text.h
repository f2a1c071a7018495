#pragma once

/// Outcomes in words for a person, from the JSON that the API and the offline commands share.

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace eigenpose::cli {

/// One line without its end: "duck at 70.0° ± 0.3 (evidence 4.2 of 0.8, confidence 0.98)". A pose that
/// cannot be observed is not printed as a number. @param outcome as outcome_json makes it.
std::string outcome_text(const nlohmann::json& outcome);

/// The pose alone: "70.0° ± 0.3"; with several DOFs "table 70.0° ± 0.3, light 12.0° ± 1.5"; "pose not
/// observable". @param outcome one outcome, or its runner_up or other_pose.
std::string pose_text(const nlohmann::json& outcome);

/// "70.0°", "12.5 mm". An angle that rounds to a full turn is 0.0°.
std::string value_text(double value, const std::string& unit);

}  // namespace eigenpose::cli
