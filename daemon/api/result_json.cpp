#include "daemon/api/result_json.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/api/json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

const Workspace* workspace_of(const Result& result, const std::string& object) {
  if (result.model == nullptr) return nullptr;
  for (const ModelObject& learned : result.model->objects)
    if (learned.name == object) return &learned.workspace;
  return nullptr;
}

/// {"table_deg": 12.3}: each value under its DOF's name and unit.
json named_pose(const Result& result, const Hypothesis& hypothesis) {
  json pose = json::object();
  const Workspace* workspace = workspace_of(result, hypothesis.object);
  if (workspace == nullptr) return pose;
  for (std::size_t i = 0; i < hypothesis.q.size() && i < workspace->size(); ++i)
    pose[(*workspace)[i].name + "_" + (*workspace)[i].unit] = hypothesis.q[i];
  return pose;
}

json to_json(const Result& result, const std::optional<Hypothesis>& hypothesis) {
  if (!hypothesis) return nullptr;
  return {{"object", hypothesis->object},
          {"q", hypothesis->q},
          {"pose", named_pose(result, *hypothesis)},
          {"distance", hypothesis->distance}};
}

json to_json(const Result& result, const Outcome& outcome) {
  json sigma = json::array();
  for (const double value : outcome.q_sigma)
    sigma.push_back(std::isfinite(value) ? json(value) : json(nullptr));
  json entry = {{"verdict", verdict_name(outcome.verdict)},
                {"box", {outcome.box.x, outcome.box.y, outcome.box.width, outcome.box.height}},
                {"object", nullptr},
                {"q", json::array()},
                {"pose", json::object()},
                {"distance", nullptr},
                {"q_sigma", std::move(sigma)},
                {"q_covariance", covariance_rows(outcome)},  // infinite numbers become null
                {"rejection_distance", outcome.rejection_distance},
                {"covered_share", outcome.covered_share},
                {"confidence", outcome.confidence},
                {"runner_up", to_json(result, outcome.runner_up)},
                {"other_pose", to_json(result, outcome.other_pose)}};
  if (outcome.best) {
    entry["object"] = outcome.best->object;
    entry["q"] = outcome.best->q;
    entry["pose"] = named_pose(result, *outcome.best);
    entry["distance"] = outcome.best->distance;
  }
  return entry;
}

double milliseconds(Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

}  // namespace

std::string result_json(const Result& result, std::uint64_t sequence) {
  json outcomes = json::array();
  for (const Outcome& outcome : result.outcomes) outcomes.push_back(to_json(result, outcome));
  json body = {{"sequence", sequence},
               {"time", iso_time(std::chrono::system_clock::now())},
               {"state", result.state == Result::State::settled ? "settled" : "changing"},
               {"frame_sequence", result.frame->sequence},
               {"exposure_monotonic_s",
                std::chrono::duration<double>(result.frame->exposure_start.time_since_epoch()).count()},
               {"outcomes", std::move(outcomes)},
               {"times_ms", nullptr}};
  if (result.times)
    body["times_ms"] = {{"segment", milliseconds(result.times->segment)},
                        {"normalize", milliseconds(result.times->normalize)},
                        {"project", milliseconds(result.times->project)},
                        {"search", milliseconds(result.times->search)},
                        {"total", milliseconds(result.times->total)}};
  return body.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string result_words(const Result& result) {
  std::string text;
  for (const Outcome& outcome : result.outcomes) {
    text += fmt::format("{}verdict={}", text.empty() ? "" : " ", verdict_name(outcome.verdict));
    if (outcome.verdict != Verdict::recognized || !outcome.best) continue;
    text += " object=" + outcome.best->object;
    const json pose = named_pose(result, *outcome.best);
    for (const auto& [key, value] : pose.items()) text += fmt::format(" {}={:.1f}", key, value.get<double>());
  }
  return text;
}

}  // namespace eigenpose
