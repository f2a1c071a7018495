#pragma once

/// What ends a recognition early.

#include <chrono>
#include <stop_token>

#include "core/base/clock.h"

namespace eigenpose {

/// Limits of one call of Recognizer::recognize. Everything but the search for touching objects takes
/// milliseconds; that search may look at a region of clutter thousands of times. It ends within one look
/// (some milliseconds) of a limit, and the outcomes of its region say that it is not finished.
struct RecognitionLimits {
  std::stop_token stop = {};
  /// For the search in one region. The default has no effect, so that results depend on nothing but the
  /// picture.
  Duration region_time = Duration::max();
  /// For the search in all regions of a picture together: a region gets what those before it have left. The
  /// default has no effect.
  Duration frame_time = Duration::max();
};

}  // namespace eigenpose
