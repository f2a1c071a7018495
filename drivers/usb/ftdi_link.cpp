#include "drivers/usb/ftdi_link.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <sys/time.h>

#include "core/base/error.h"
#include "drivers/usb/ftdi_baud.h"
#include "drivers/usb/ftdi_device.h"
#include "drivers/usb/usb_chips.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;

constexpr Duration look_again = 100ms;  ///< between two looks for a device that is gone

/// Waits for something to be plugged in: by libusb's hotplug events, or, where the system has none, by
/// patience.
class ArrivalWatch {
 public:
  ArrivalWatch() {
    if (libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0) return;
    const auto on_arrival = [](libusb_context*, libusb_device*, libusb_hotplug_event, void* watch) {
      static_cast<ArrivalWatch*>(watch)->arrived_ = 1;
      return 0;
    };
    registered_ = libusb_hotplug_register_callback(
                      context_.get(), LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, 0, vendor_ftdi,
                      LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, on_arrival, this, &callback_) == 0;
  }
  ArrivalWatch(const ArrivalWatch&) = delete;
  ArrivalWatch& operator=(const ArrivalWatch&) = delete;
  ~ArrivalWatch() {
    if (registered_) libusb_hotplug_deregister_callback(context_.get(), callback_);
  }

  /// Returns when a chip arrives, or after `patience`.
  void wait(Duration patience, const Clock& clock) {
    if (!registered_) {
      clock.sleep_for(patience);
      return;
    }
    arrived_ = 0;
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(patience).count();
    timeval timeout{us / 1'000'000, us % 1'000'000};
    libusb_handle_events_timeout_completed(context_.get(), &timeout, &arrived_);
  }

 private:
  UsbContext context_;
  libusb_hotplug_callback_handle callback_ = 0;
  bool registered_ = false;
  int arrived_ = 0;
};

}  // namespace

FtdiLink::FtdiLink(FtdiLinkOptions options, const Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      description_(options_.serial.empty() ? "USB serial chip" : "USB serial number " + options_.serial) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument(description_ + ": " + what);
  };
  if (options_.interface < 0 || options_.interface > 3)
    refuse(fmt::format("interface must be 0 … 3, got {}", options_.interface));
  if (options_.parity != 'N' && options_.parity != 'E' && options_.parity != 'O')
    refuse(fmt::format("parity must be N, E or O, got {}", options_.parity));
  if (options_.stop_bits != 1 && options_.stop_bits != 2)
    refuse(fmt::format("stop bits must be 1 or 2, got {}", options_.stop_bits));
  if (options_.latency < 1ms || options_.latency > 255ms)
    refuse(fmt::format("latency must be 1 … 255 ms, got {}", options_.latency.count()));
  (void)ftdi::baud_divisor(options_.baud);
}

FtdiLink::~FtdiLink() = default;

FtdiLink::Device& FtdiLink::device() {
  if (lost_) throw DeviceLost(description_, "use", "unplugged");
  if (!device_) device_ = std::make_unique<Device>(options_, description_);
  return *device_;
}

void FtdiLink::write(std::span<const std::uint8_t> bytes, TimePoint deadline) {
  try {
    while (!bytes.empty()) {
      const Duration left = deadline - clock_.now();
      if (left <= Duration::zero()) throw DeviceTimeout(description_, "write", "the device takes no bytes");
      bytes = bytes.subspan(device().send(bytes, left));
    }
  } catch (const DeviceLost&) {
    lost_ = true;
    device_.reset();
    throw;
  }
}

std::size_t FtdiLink::read(std::span<std::uint8_t> buffer, TimePoint deadline) {
  try {
    for (;;) {
      if (const std::size_t count = device().take(buffer); count > 0) return count;
      const Duration left = deadline - clock_.now();
      if (left <= Duration::zero()) return 0;
      device().receive(left);
    }
  } catch (const DeviceLost&) {
    lost_ = true;
    device_.reset();
    throw;
  }
}

void FtdiLink::discard_input() {
  try {
    device().discard();
  } catch (const DeviceLost&) {
    lost_ = true;
    device_.reset();
    throw;
  }
}

void FtdiLink::reopen(TimePoint deadline) {
  device_.reset();
  ArrivalWatch watch;
  for (;;) {
    try {
      device_ = std::make_unique<Device>(options_, description_);
      lost_ = false;
      return;
    } catch (const DeviceError&) {
      // Also one that may not be opened yet: the rules that give it to its group run after it has arrived.
      lost_ = true;
      const Duration left = deadline - clock_.now();
      if (left <= Duration::zero()) throw;
      watch.wait(std::min<Duration>(left, look_again), clock_);
    }
  }
}

}  // namespace eigenpose
