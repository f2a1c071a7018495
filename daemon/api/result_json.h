#pragma once

/// A result of watching as one line of JSON.

#include <cstdint>
#include <string>

#include "daemon/service/events.h"

namespace eigenpose {

/// daemon/api/README.md describes the keys.
std::string result_json(const SceneResult& result, std::uint64_t sequence);

}  // namespace eigenpose
