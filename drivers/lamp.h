#pragma once

/// What Eigenpose needs of a light source, no more.

#include <cstdint>
#include <string>

#include "core/base/clock.h"

namespace eigenpose {

struct LampInfo {
  std::string name;   ///< the configuration's name for it
  std::string model;  ///< "Enttec DMX USB Pro", …
};

/// A lamp with one level. Lives on one thread. Goes dark when destroyed.
class Lamp {
 public:
  virtual ~Lamp() = default;
  [[nodiscard]] virtual const LampInfo& info() const = 0;
  /// @param level 0 (dark) … 1 (full). @throws std::out_of_range; DeviceError and its kinds.
  virtual void set_level(double level, TimePoint deadline) = 0;
  /// The level last set; it has been read back where the device can be asked for it.
  [[nodiscard]] virtual double level() const = 0;
  /// Grows with each `set_level` that finds that the lamp may have lost its level meanwhile: its device had
  /// to be connected anew, or showed another level than it was set to. A picture that was taken between two
  /// calls of `set_level` is known to be lit only if this has not grown.
  [[nodiscard]] virtual std::uint64_t interruptions() const = 0;

 protected:
  Lamp() = default;
  Lamp(const Lamp&) = default;
  Lamp& operator=(const Lamp&) = default;
};

}  // namespace eigenpose
