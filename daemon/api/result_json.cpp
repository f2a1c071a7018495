#include "daemon/api/result_json.h"

#include <chrono>
#include <cmath>

#include <nlohmann/json.hpp>

#include "daemon/api/json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

/// {"table_deg": 12.3}: each value under its DOF's name and unit.
json named_pose(const SceneResult& result, const Hypothesis& hypothesis) {
  json pose = json::object();
  const Workspace* workspace = workspace_of(result, hypothesis.object);
  if (workspace == nullptr) return pose;
  for (std::size_t i = 0; i < hypothesis.q.size() && i < workspace->size(); ++i)
    pose[(*workspace)[i].name + "_" + (*workspace)[i].unit] = hypothesis.q[i];
  return pose;
}

json to_json(const SceneResult& result, const std::optional<Hypothesis>& hypothesis) {
  if (!hypothesis) return nullptr;
  return {{"object", hypothesis->object},
          {"q", hypothesis->q},
          {"pose", named_pose(result, *hypothesis)},
          {"distance", hypothesis->distance}};
}

json to_json(const SceneResult& result, const Outcome& outcome) {
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

std::string result_json(const SceneResult& result, std::uint64_t sequence) {
  json outcomes = json::array();
  for (const Outcome& outcome : result.outcomes) outcomes.push_back(to_json(result, outcome));
  json body = {{"sequence", sequence},
               {"time", iso_time(result.time)},
               {"state", result.state == SceneResult::State::settled ? "settled" : "changing"},
               {"frame_sequence", result.frame.sequence},
               {"exposure_monotonic_s",
                std::chrono::duration<double>(result.frame.exposure_start.time_since_epoch()).count()},
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

}  // namespace eigenpose
