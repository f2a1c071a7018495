#pragma once

/// How `evaluate` shows its results: first what a user gets, then how it came about.

#include <optional>

#include <nlohmann/json.hpp>

#include "core/evaluation/evaluation.h"
#include "core/evaluation/reliability.h"

namespace eigenpose::cli {

/// Keys in this order: what a user gets first. Rates are 0…1, of what was not shown null.
/// @param confidence if asked for: expected_calibration_error.
nlohmann::ordered_json evaluation_json(const EvaluationReport& report,
                                       const std::optional<Reliability>& confidence);

/// The same as text on stdout.
void print_evaluation(const EvaluationReport& report, const std::optional<Reliability>& confidence);

}  // namespace eigenpose::cli
