#pragma once

/// The seam below a device's protocol: bytes out, bytes in, and a deadline. A USB serial chip, or a simulated
/// controller in the same process.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/base/clock.h"

namespace eigenpose {

/// A two-way stream of bytes to one device. One thread at a time.
///
/// After DeviceLost every call but `reopen` throws DeviceLost again. Bytes that were under way are then gone.
class ByteLink {
 public:
  virtual ~ByteLink() = default;

  /// Sends all of `bytes`. @throws DeviceTimeout when the device takes them too slowly (some may have gone),
  /// DeviceLost.
  virtual void write(std::span<const std::uint8_t> bytes, TimePoint deadline) = 0;

  /// Waits for at least one byte. @return how many stand in `buffer` now; 0 when none came before `deadline`.
  /// @throws DeviceLost; DeviceError when bytes were damaged or lost on the way.
  virtual std::size_t read(std::span<std::uint8_t> buffer, TimePoint deadline) = 0;

  /// Forgets what has come in and was not read. @throws DeviceLost.
  virtual void discard_input() = 0;

  /// Finds the device again and sets it up as at first. Does no harm on a link that works.
  /// @throws DeviceLost when it is not there.
  virtual void reopen(TimePoint deadline) = 0;

  /// "USB serial number 83812345", for messages.
  [[nodiscard]] virtual const std::string& description() const = 0;

 protected:
  ByteLink() = default;
  ByteLink(const ByteLink&) = default;
  ByteLink& operator=(const ByteLink&) = default;
};

}  // namespace eigenpose
