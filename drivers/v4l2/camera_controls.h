#pragma once

/// A camera's knobs, by the names that v4l2-ctl shows: exposure_time_absolute, gain,
/// white_balance_temperature, …

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/v4l2/video_system.h"

namespace eigenpose {

/// One control as the driver describes it.
struct ControlInfo {
  std::uint32_t id = 0;
  std::string name;  ///< "exposure_time_absolute"
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  std::int64_t step = 1;
  std::int64_t preset = 0;  ///< the driver's default
  bool settable = false;    ///< a number, and neither read-only nor disabled
  bool has_value = false;   ///< a number that can be read
};

/// What was asked of a control, and what it is now.
struct ControlResult {
  std::string name;
  std::int64_t requested = 0;
  std::optional<std::int64_t> granted;  ///< as read back; nothing when refused
  std::string problem;                  ///< empty when granted as requested
};

/// V4L2's rule: letters and digits stay, in lower case; every run of anything else becomes one underscore.
std::string control_name(const std::string& title);

/// Whether a control shapes the picture (exposure, gain, white balance, focus, tone), and so belongs to its
/// record.
bool is_picture_control(std::uint32_t id);

/// The controls of one open device. Refers to the device, which must outlive it. Lives on one thread.
class CameraControls {
 public:
  explicit CameraControls(VideoDevice& device);

  [[nodiscard]] const std::vector<ControlInfo>& list() const { return controls_; }
  [[nodiscard]] const ControlInfo* find(const std::string& name) const;

  /// @return nothing when the driver refuses.
  [[nodiscard]] std::optional<std::int64_t> read(const ControlInfo& control) const;

  /// Turns off everything by which the camera changes the picture on its own: exposure, gain, white balance,
  /// focus, frame rate for the sake of exposure. Controls the camera does not have are passed over.
  std::vector<ControlResult> lock_automatics();

  /// Sets by name, automatics first, since a value is only free once its automatic is off. A value the camera
  /// refuses or changes is reported, not thrown.
  std::vector<ControlResult> apply(const std::map<std::string, std::int64_t>& values);

  /// All values that can be read.
  [[nodiscard]] std::map<std::string, std::int64_t> snapshot() const;

  /// The exposure time, when the camera tells it and does not change it by itself.
  [[nodiscard]] std::optional<Duration> locked_exposure() const;

 private:
  ControlResult set(const ControlInfo& control, std::int64_t value);
  [[nodiscard]] const ControlInfo* find(std::uint32_t id) const;

  VideoDevice& device_;
  std::vector<ControlInfo> controls_;
};

}  // namespace eigenpose
