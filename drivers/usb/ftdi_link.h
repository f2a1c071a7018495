#pragma once

/// A USB serial chip of FTDI, spoken to through libusb itself: no kernel tty, no libserialport.
///
/// The kernel's own driver (ftdi_sio) is detached while the link is open and given back afterwards. The chip
/// puts two status bytes in front of every packet it sends; they are taken out here, and the errors they
/// report are raised.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/usb/byte_link.h"

namespace eigenpose {

enum class FtdiFlowControl { none, rts_cts, xon_xoff };

struct FtdiLinkOptions {
  std::string serial{};  ///< of the chip, as `list_ftdi_devices` shows it; empty: the only one that is there
  int interface = 0;     ///< channel of a chip that has several, 0 … 3
  int baud = 115200;     ///< 184 … 3,000,000
  char parity = 'N';     ///< 'N', 'E', 'O'
  int stop_bits = 1;     ///< 1 or 2
  FtdiFlowControl flow_control = FtdiFlowControl::none;
  /// How long the chip gathers bytes before it sends an unfilled packet, 1 … 255 ms. Short answers wait for
  /// it.
  std::chrono::milliseconds latency{2};
};

/// What is plugged in.
struct FtdiDevice {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;      ///< empty when it has none or may not be opened
  std::string name;        ///< what it calls itself
  std::string bus_path;    ///< "1-2.3": bus and ports
  bool accessible = true;  ///< this user may open it
};

/// Every chip that could be one of ours, by USB numbers. @throws DeviceError when USB itself cannot be used.
std::vector<FtdiDevice> list_ftdi_devices();

/// One thread at a time. Opens the device at the first call that needs it.
class FtdiLink final : public ByteLink {
 public:
  /// Does not touch the device. @param clock must outlive the link. @throws std::invalid_argument on
  /// impossible options.
  FtdiLink(FtdiLinkOptions options, const Clock& clock);
  FtdiLink(const FtdiLink&) = delete;
  FtdiLink& operator=(const FtdiLink&) = delete;
  ~FtdiLink() override;

  void write(std::span<const std::uint8_t> bytes, TimePoint deadline) override;
  std::size_t read(std::span<std::uint8_t> buffer, TimePoint deadline) override;
  void discard_input() override;
  /// Closes, and waits until `deadline` for the device to be there.
  void reopen(TimePoint deadline) override;
  [[nodiscard]] const std::string& description() const override { return description_; }

 private:
  class Device;
  Device& device();

  FtdiLinkOptions options_;
  const Clock& clock_;
  std::string description_;
  std::unique_ptr<Device> device_;  ///< empty before the first use
  bool lost_ = false;
};

}  // namespace eigenpose
