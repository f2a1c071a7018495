#pragma once

/// Points in time as text.

#include <chrono>
#include <string>

namespace eigenpose {

enum class UtcDigits { seconds, milliseconds };

/// ISO 8601 in UTC, cut off below the digits: "2026-11-22T02:03:04Z", "2026-11-22T02:03:04.567Z".
std::string utc_text(std::chrono::system_clock::time_point time, UtcDigits digits);

}  // namespace eigenpose
