#pragma once

/// Moving one device by hand, with the service stopped.

#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "config/config.h"
#include "core/base/clock.h"
#include "daemon/devices.h"

namespace eigenpose {

/// The configured devices in the hands of a person. One thread at a time; `clock` must outlive it.
class HandControl {
 public:
  /// Opens nothing yet. @throws ConfigError; Error when the service is running, since two masters on one
  /// drive end in a broken arm.
  HandControl(const Config& config, const Clock& clock);
  /// The same with devices that were made elsewhere.
  HandControl(Devices devices, const Clock& clock);

  [[nodiscard]] std::vector<std::string> axis_names() const;

  /// Where the axis stands. @throws ConfigError for a name that is not configured, DeviceError and its kinds.
  AxisState state(const std::string& axis);

  /// Homes. Motion ends with Interrupted on `stop`; then, as after any failure, the drive was commanded to
  /// stop.
  void home(const std::string& axis, std::stop_token stop);

  /// Moves to `position`, in the axis's unit. Limits are those of the configuration.
  /// @return the position read back. @throws std::out_of_range before anything moves; DeviceError (not homed,
  /// …).
  double jog_to(const std::string& axis, double position, std::stop_token stop);
  /// The same by `distance` from where the axis stands. An axis that is not homed does not know its limits,
  /// and moves by `longest_unhomed_jog` at most.
  double jog_by(const std::string& axis, double distance, std::stop_token stop);

  /// Lights a lamp; it goes dark with this object. @param level 0 … 1. @throws std::out_of_range;
  /// DeviceError.
  void light(const std::string& lamp, double level);

  [[nodiscard]] const std::string& unit_of(const std::string& axis) const;

 private:
  struct OpenAxis {
    const RigAxis* setup;
    std::unique_ptr<Axis> axis;
  };
  OpenAxis& open(const std::string& name);
  [[nodiscard]] const RigAxis& setup_of(const std::string& name) const;

  const Clock& clock_;
  Devices devices_;
  std::map<std::string, OpenAxis> axes_;
  std::map<std::string, std::unique_ptr<Lamp>> lamps_;
};

}  // namespace eigenpose
