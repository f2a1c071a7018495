#pragma once

/// The service's events as lines of JSON.

#include <cstdint>
#include <string>

#include "daemon/service/events.h"

namespace eigenpose {

/// Which event of which run of the program this is.
struct EventNumber {
  std::uint64_t sequence = 0;
  std::string run;
};

/// daemon/api/README.md describes the keys.
std::string result_json(const SceneResult& result, const EventNumber& number);

std::string camera_lost_json(const CameraLost& lost, const EventNumber& number);
std::string camera_found_json(const EventNumber& number);

}  // namespace eigenpose
