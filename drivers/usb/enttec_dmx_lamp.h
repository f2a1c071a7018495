#pragma once

/// A DMX512 lamp behind an Enttec DMX USB Pro: a level, spread over channels.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/lamp.h"
#include "drivers/usb/byte_link.h"

namespace eigenpose {

/// A channel, and how far it follows the level: {1, 1.0} for a plain dimmer; {1, 1.0}, {2, 0.8}, {3, 0.6} for
/// a warm white of a lamp with red, green and blue on channels 1, 2 and 3.
struct DmxChannel {
  int number = 1;      ///< 1 … 512
  double share = 1.0;  ///< 0 … 1 of the level
};

struct EnttecDmxLampOptions {
  std::string name = "lamp";
  std::vector<DmxChannel> channels = {{1, 1.0}};
  Duration response_timeout = std::chrono::milliseconds(500);
  int attempts = 3;  ///< 1 … 10
};

/// Lives on one thread. Goes dark when destroyed.
///
/// The widget repeats the last frame to the lamp by itself, so a level stays until it is changed. It does not
/// acknowledge frames; after each one it is asked for its parameters, and the answer shows that it still
/// listens.
class EnttecDmxLamp final : public Lamp {
 public:
  /// Does not touch the device. @param clock must outlive the lamp. @throws std::invalid_argument.
  EnttecDmxLamp(EnttecDmxLampOptions options, std::unique_ptr<ByteLink> link, const Clock& clock);
  ~EnttecDmxLamp() override;

  [[nodiscard]] const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint deadline) override;
  [[nodiscard]] double level() const override { return level_; }

  /// Changes the colour and shows it at the present level. @param shares one for each channel, 0 … 1.
  /// @throws std::out_of_range; std::invalid_argument on another count; DeviceError and its kinds.
  void set_color(const std::vector<double>& shares, TimePoint deadline);

 private:
  void show(double level, const std::vector<DmxChannel>& channels, TimePoint deadline);
  void exchange(const std::vector<std::uint8_t>& frame, TimePoint deadline);

  EnttecDmxLampOptions options_;
  std::unique_ptr<ByteLink> link_;
  const Clock& clock_;
  LampInfo info_;
  double level_ = 0.0;
  bool may_be_lit_ = false;
  bool link_suspect_ = false;
};

}  // namespace eigenpose
