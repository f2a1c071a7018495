#pragma once

/// An FTDI chip that this program plays itself: the kernel's FunctionFS on its software USB controller
/// (dummy_hcd). To the host side of the same kernel it is a device like any other, with every fault a device
/// can have on the bus.

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "sim/usb/sim_link.h"

namespace eigenpose::test {

/// What is wrong with the chip. All of it may change while the chip is in use.
struct UsbChipFaults {
  bool refuses_requests = false;  ///< stalls every control request of its own
  bool deaf = false;              ///< takes no bytes: the host's writes wait
  int stalled_reads = 0;          ///< so many times the endpoint to the host is halted
  int stalled_writes = 0;        ///< so many times the endpoint from the host is halted, after the next bytes
  int headless_packets = 0;      ///< so many packets are empty or have one of their two status bytes, in turn
  std::uint8_t line_errors = 0;  ///< the chip's error bits (02 overrun, 04 parity, 08 framing), told once
  int vanishes_after_sending = -1;  ///< unplugs itself when it has sent so many more bytes; −1: does not
  int vanishes_after_hearing = -1;  ///< unplugs itself when it has taken so many more bytes; −1: does not
  bool silent = false;              ///< what the device behind it says is lost
};

/// Thread-safe. One in a guest: the guest ends with the program, so nothing of it is taken down.
/// The guest loads `dummy_hcd is_high_speed=0 is_super_speed=0`, `libcomposite` and `usb_f_fs`.
class UsbChip {
 public:
  /// Makes the chip; it is not plugged in yet. @throws std::runtime_error when the kernel lacks something.
  explicit UsbChip(std::string serial);
  UsbChip(const UsbChip&) = delete;
  UsbChip& operator=(const UsbChip&) = delete;
  ~UsbChip();

  [[nodiscard]] const std::string& serial() const { return serial_; }
  /// What stands at the chip's serial side; null: nothing. It must outlive its place here.
  void wire(sim::ByteDevice* device);
  void set_faults(const UsbChipFaults& faults);
  /// Those that are still due.
  [[nodiscard]] UsbChipFaults faults() const;

  void plug_in();
  void unplug();

 private:
  void serve_requests(const std::stop_token& stop);
  void serve_host_reads(const std::stop_token& stop);
  void serve_host_writes(const std::stop_token& stop);
  std::vector<std::uint8_t> next_packet(bool& last);

  const std::string serial_;
  int control_ = -1;
  int to_host_ = -1;
  int from_host_ = -1;
  std::mutex plug_mutex_;
  bool plugged_ = false;  ///< guarded by plug_mutex_
  mutable std::mutex mutex_;
  std::condition_variable_any news_;
  sim::ByteDevice* device_ = nullptr;  ///< guarded by mutex_
  UsbChipFaults faults_;               ///< guarded by mutex_
  std::vector<std::uint8_t> waiting_;  ///< guarded by mutex_: for the host
  std::vector<std::jthread> threads_;
};

}  // namespace eigenpose::test
