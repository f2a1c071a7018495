#pragma once

/// One picture from a camera, with the facts that make it evidence.

#include <cstdint>

#include <opencv2/core.hpp>

#include "core/base/clock.h"

namespace eigenpose {

/// A camera frame. `image` is CV_8UC1 (grey), CV_8UC3 (BGR) or CV_16UC1 and is shared, never written to after
/// the frame was handed out.
struct Frame {
  cv::Mat image;
  /// No photon of this picture is older than this. Compare with the time an axis settled.
  TimePoint exposure_start{};
  /// Counts every picture the camera took, also those that were not fetched; never goes back while the camera
  /// is open.
  std::uint64_t sequence = 0;
};

}  // namespace eigenpose
