#pragma once

/// What Eigenpose needs of a camera, no more.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <stop_token>
#include <string>
#include <string_view>

#include "core/base/clock.h"
#include "core/image/frame.h"

namespace eigenpose {

/// What was granted when the camera was opened.
struct CameraInfo {
  std::string name;    ///< the configuration's name for it
  std::string model;   ///< what the device calls itself
  std::string serial;  ///< empty if it has none
  std::string format;  ///< "YUYV", "GREY", "simulated", …
  int width = 0;       ///< pixels
  int height = 0;      ///< pixels
  double frames_per_second = 0.0;
  std::map<std::string, std::int64_t> controls;  ///< by V4L2 name, as read back after setting
};

/// Why a frame that the camera sent was not handed out.
enum class FrameFault {
  none,
  marked_by_device,  ///< the driver says that it is damaged
  too_short,         ///< empty, or fewer bytes than the picture has
  no_image,          ///< no JPEG header
  unsupported,       ///< a kind of JPEG that is not decoded
  wrong_size,        ///< of another size than the camera granted
  cut_short,         ///< compressed data that ends before the last pixel
  damaged_data,      ///< compressed data that cannot be decoded
};
constexpr std::size_t frame_fault_count = 8;

/// In words: "cut short". For status and logs.
constexpr std::string_view name_of(FrameFault fault) {
  constexpr std::array<std::string_view, frame_fault_count> names{
      "none",        "marked as damaged by the driver",
      "too short",   "no image",
      "unsupported", "of another size",
      "cut short",   "damaged data"};
  return names.at(static_cast<std::size_t>(fault));
}

/// Counts since the camera was opened.
struct CameraStatistics {
  std::uint64_t frames_taken = 0;    ///< handed out
  std::uint64_t frames_dropped = 0;  ///< taken by the device, never handed out: a newer one was there
  std::uint64_t frames_damaged = 0;  ///< marked as an error by the device or not decodable, never handed out
  std::uint64_t times_lost = 0;      ///< how often the device went away
  /// `frames_damaged` by reason: index with a FrameFault. A driver that gives no reasons leaves it at 0.
  std::array<std::uint64_t, frame_fault_count> damaged_by{};
};

/// A camera. Lives on one thread, except `statistics`, which any thread may call.
class Camera {
 public:
  virtual ~Camera() = default;

  [[nodiscard]] virtual const CameraInfo& info() const = 0;

  /// The newest frame not handed out yet; waits for one if there is none. Older ones are dropped and counted.
  /// @throws DeviceTimeout when none came before `deadline`; DeviceLost when the camera is gone: then a later
  /// call tries to find and reopen it; Interrupted on `stop`.
  virtual Frame next_frame(TimePoint deadline, std::stop_token stop) = 0;

  [[nodiscard]] virtual CameraStatistics statistics() const = 0;

 protected:
  Camera() = default;
  Camera(const Camera&) = default;
  Camera& operator=(const Camera&) = default;
};

}  // namespace eigenpose
