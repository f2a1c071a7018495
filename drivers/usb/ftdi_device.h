#pragma once

/// Inside FtdiLink: one open chip. Not for other folders.

#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "drivers/usb/ftdi_link.h"
#include "drivers/usb/usb_chips.h"

namespace eigenpose {

/// An open, claimed and set up chip. Gives the kernel its driver back in the destructor. One thread at a
/// time.
class FtdiLink::Device {
 public:
  /// @param options and name outlive the device. @throws DeviceError and its kinds.
  Device(const FtdiLinkOptions& options, const std::string& name);
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device();

  /// @return bytes taken by the device; fewer than given when `timeout` ran out.
  std::size_t send(std::span<const std::uint8_t> bytes, Duration timeout);
  /// One transfer into the queue of received bytes. @throws DeviceError on an error the chip reports.
  void receive(Duration timeout);
  /// Bytes out of that queue. @return how many.
  std::size_t take(std::span<std::uint8_t> buffer);
  /// Forgets what was received, here and in the chip.
  void discard();

 private:
  [[noreturn]] void damaged(const std::string& what);
  /// A halted endpoint refuses everything until it is told to go on; so the next call finds it ready.
  [[noreturn]] void fail_at(std::uint8_t endpoint, int result, const std::string& operation) const;
  [[noreturn]] void fail(int result, const std::string& operation) const;
  void check(int result, const std::string& operation) const;
  void find();
  void find_endpoints();
  void control(std::uint8_t request, std::uint16_t value, std::uint16_t index);
  void set_up();

  const FtdiLinkOptions& options_;
  const std::string& name_;
  UsbContext context_;
  UsbHandle handle_;
  bool claimed_ = false;
  bool several_channels_ = false;
  std::uint8_t endpoint_in_ = 0;
  std::uint8_t endpoint_out_ = 0;
  int packet_size_ = 0;
  std::vector<std::uint8_t> packets_;
  std::deque<std::uint8_t> received_;
};

}  // namespace eigenpose
