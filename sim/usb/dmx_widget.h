#pragma once

/// A simulated Enttec DMX USB Pro, byte by byte. Written from "DMX USB Pro Widget API Specification 1.44",
/// apart from any driver.

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

#include "sim/usb/sim_link.h"

namespace eigenpose::sim {

/// Thread-safe.
class DmxWidget final : public ByteDevice {
 public:
  /// @param on_frame hears of every frame that goes out, with the values of channels 1 … 512. May be empty.
  explicit DmxWidget(std::function<void(const std::array<std::uint8_t, 512>&)> on_frame = {});

  std::vector<std::uint8_t> receive(std::span<const std::uint8_t> bytes) override;

  /// What the lamp sees. @param channel 1 … 512.
  [[nodiscard]] std::uint8_t channel(int channel) const;
  [[nodiscard]] int frames() const;

 private:
  void obey(std::uint8_t label, std::span<const std::uint8_t> data, std::vector<std::uint8_t>& answer);

  std::function<void(const std::array<std::uint8_t, 512>&)> on_frame_;
  mutable std::mutex mutex_;
  std::vector<std::uint8_t> heard_;           ///< guarded by mutex_
  std::array<std::uint8_t, 512> channels_{};  ///< guarded by mutex_
  int frames_ = 0;                            ///< guarded by mutex_
};

}  // namespace eigenpose::sim
