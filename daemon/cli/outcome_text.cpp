#include "daemon/cli/outcome_text.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/printable.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

/// "table_deg" → "table" and "deg".
std::pair<std::string, std::string> name_and_unit(const std::string& key) {
  const std::size_t mark = key.rfind('_');
  if (mark == std::string::npos) return {key, ""};
  return {key.substr(0, mark), key.substr(mark + 1)};
}

std::string numbers_text(const json& outcome) {
  std::string text =
      fmt::format("evidence {:.1f} of {:.1f}, confidence {:.2f}", outcome.at("evidence").get<double>(),
                  outcome.at("required_evidence").get<double>(), outcome.at("confidence").get<double>());
  // Occlusion raises the distance: said where a person would wonder about it.
  const double occluded = outcome.value("covered_share", 0.0);
  if (occluded >= 0.05) text += fmt::format(", {:.0f} % occluded", 100.0 * occluded);
  return text;
}

constexpr const char* not_observable = "pose not observable";

std::string object_at(const json& hypothesis) {
  const std::string pose = pose_text(hypothesis);
  const std::string object = printable(hypothesis.at("object").get<std::string>());
  if (pose.empty()) return object;
  return object + (pose == not_observable ? ", " : " at ") + pose;
}

}  // namespace

std::string value_text(double value, const std::string& unit) {
  if (unit != "deg") return fmt::format("{:.1f} {}", value, unit);
  double rounded = std::round(10.0 * value) / 10.0;
  if (rounded == 360.0 || rounded == 0.0) rounded = 0.0;  // neither a full turn nor minus zero
  return fmt::format("{:.1f}°", rounded);
}

std::string pose_text(const json& outcome) {
  const json& pose = outcome.at("pose");
  const json sigmas = outcome.value("pose_sigma", json::object());
  std::string text;
  bool anything = pose.empty();
  for (const auto& [key, value] : pose.items()) {
    const auto [name, unit] = name_and_unit(key);
    text += text.empty() ? "" : ", ";
    if (pose.size() > 1) text += printable(name) + " ";
    if (!value.is_number()) {
      text += "not observable";
      continue;
    }
    anything = true;
    text += value_text(value.get<double>(), unit);
    const auto sigma = sigmas.find(key);
    if (sigma != sigmas.end() && sigma->is_number()) text += fmt::format(" ± {:.1f}", sigma->get<double>());
  }
  return anything ? text : not_observable;
}

std::string outcome_text(const json& outcome) {
  const std::string verdict = outcome.at("verdict").get<std::string>();
  const bool has_best = outcome.at("object").is_string();
  if (verdict == "touches_border") return "something that touches the border of the picture";
  if (verdict == "too_small") return "something too small to recognise";
  if (verdict == "unknown") {
    if (!has_best) return "unknown object";
    return fmt::format("unknown object (most like {}: evidence {:.1f} of {:.1f})",
                       printable(outcome.at("object").get<std::string>()),
                       outcome.at("evidence").get<double>(), outcome.at("required_evidence").get<double>());
  }
  if (!has_best) return printable(verdict);
  std::string text = object_at(outcome);
  const json& runner_up = outcome.at("runner_up");
  if (verdict == "ambiguous" && runner_up.is_object()) text += " or " + object_at(runner_up);
  const json& other_pose = outcome.at("other_pose");
  if (other_pose.is_object() && pose_text(other_pose) != not_observable)
    text += " or at " + pose_text(other_pose);
  return text + " (" + numbers_text(outcome) + ")";
}

}  // namespace eigenpose::cli
