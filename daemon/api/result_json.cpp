#include "daemon/api/result_json.h"

#include <chrono>

#include <nlohmann/json.hpp>

#include "core/base/utc_text.h"
#include "daemon/api/json/outcome_json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

double milliseconds(Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

json numbered(const EventNumber& number) {
  return {{"sequence", number.sequence}, {"run", number.run}};
}

std::string line_of(const json& body) {
  return body.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

std::string result_json(const SceneResult& result, const EventNumber& number) {
  json outcomes = json::array();
  for (const Outcome& outcome : result.outcomes) outcomes.push_back(outcome_json(outcome, *result.model));
  json body = numbered(number);
  body["time"] = utc_text(result.time, UtcDigits::milliseconds);
  body["state"] = result.state == SceneResult::State::settled ? "settled" : "changing";
  body["frame_sequence"] = result.frame.sequence;
  body["exposure_monotonic_s"] =
      std::chrono::duration<double>(result.frame.exposure_start.time_since_epoch()).count();
  body["outcomes"] = std::move(outcomes);
  body["times_ms"] = nullptr;
  if (result.times)
    body["times_ms"] = {{"segment", milliseconds(result.times->segment)},
                        {"normalize", milliseconds(result.times->normalize)},
                        {"project", milliseconds(result.times->project)},
                        {"search", milliseconds(result.times->search)},
                        {"total", milliseconds(result.times->total)}};
  return line_of(body);
}

std::string camera_lost_json(const CameraLost& lost, const EventNumber& number) {
  json body = numbered(number);
  body["error"] = lost.error;
  return line_of(body);
}

std::string camera_found_json(const EventNumber& number) {
  return line_of(numbered(number));
}

}  // namespace eigenpose
