#pragma once

/// DMX512 lamps behind an Enttec DMX USB Pro: each a level, spread over channels.

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
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

struct EnttecDmxWidgetOptions {
  Duration response_timeout = std::chrono::milliseconds(500);
  int attempts = 3;  ///< 1 … 10
};

/// The Enttec DMX USB Pro: one line of 512 channels, which several lamps may share. Thread-safe.
///
/// It repeats the last frame to the lamps by itself, so a level stays until it is changed. It does not
/// acknowledge frames; after each one it is asked for its parameters, and the answer shows that it still
/// listens. DMX goes one way only: what a lamp behind it shows cannot be asked.
class EnttecDmxWidget {
 public:
  /// Does not touch the device. @param clock must outlive the widget. @throws std::invalid_argument.
  EnttecDmxWidget(EnttecDmxWidgetOptions options, std::unique_ptr<ByteLink> link, const Clock& clock);
  EnttecDmxWidget(const EnttecDmxWidget&) = delete;
  EnttecDmxWidget& operator=(const EnttecDmxWidget&) = delete;
  ~EnttecDmxWidget();

  /// What each channel shows, by its number, 1 … 512.
  using Values = std::map<int, std::uint8_t>;

  /// Shows `values` and leaves all other channels as they are. @param lamp opens the text of every error.
  /// @throws DeviceError and its kinds; then other lamps' frames go on without these values.
  void show(const std::string& lamp, const Values& values, TimePoint deadline);
  /// How often its link had to be opened anew. It may have been without power each time.
  [[nodiscard]] std::uint64_t interruptions() const;

 private:
  void exchange(const std::string& lamp, const std::vector<std::uint8_t>& frame, TimePoint deadline);

  EnttecDmxWidgetOptions options_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  std::unique_ptr<ByteLink> link_;   ///< guarded by mutex_
  Values shown_;                     ///< guarded by mutex_: dark where there is none
  bool link_suspect_ = false;        ///< guarded by mutex_: opened anew before the next use
  std::uint64_t interruptions_ = 0;  ///< guarded by mutex_
};

struct EnttecDmxLampOptions {
  std::string name = "lamp";
  std::vector<DmxChannel> channels = {{1, 1.0}};
};

/// Lives on one thread. Goes dark when destroyed.
class EnttecDmxLamp final : public Lamp {
 public:
  /// Does not touch the device. @param clock must outlive the lamp. @throws std::invalid_argument.
  EnttecDmxLamp(EnttecDmxLampOptions options, std::shared_ptr<EnttecDmxWidget> widget, const Clock& clock);
  ~EnttecDmxLamp() override;

  [[nodiscard]] const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint deadline) override;
  [[nodiscard]] double level() const override { return level_; }
  /// Of its widget: all lamps on it are lit anew with any of them.
  [[nodiscard]] std::uint64_t interruptions() const override { return widget_->interruptions(); }

 private:
  void show(double level, TimePoint deadline);

  EnttecDmxLampOptions options_;
  std::shared_ptr<EnttecDmxWidget> widget_;
  const Clock& clock_;
  LampInfo info_;
  double level_ = 0.0;
  bool may_be_lit_ = false;
};

}  // namespace eigenpose
