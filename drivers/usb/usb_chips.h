#pragma once

/// Owners of libusb's context and handles, and the FTDI chips that are plugged in. Not for other folders.

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <libusb-1.0/libusb.h>

#include "drivers/usb/ftdi_link.h"

namespace eigenpose {

constexpr std::uint16_t vendor_ftdi = 0x0403;

/// libusb's own state. One for each link, so that links live on threads of their own.
class UsbContext {
 public:
  /// @throws DeviceError.
  UsbContext();
  UsbContext(const UsbContext&) = delete;
  UsbContext& operator=(const UsbContext&) = delete;
  ~UsbContext() { libusb_exit(context_); }
  [[nodiscard]] libusb_context* get() const { return context_; }

 private:
  libusb_context* context_ = nullptr;
};

/// An open device. Closed in the destructor.
class UsbHandle {
 public:
  UsbHandle() = default;
  explicit UsbHandle(libusb_device_handle* handle) : handle_(handle) {}
  UsbHandle(UsbHandle&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  UsbHandle& operator=(UsbHandle&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~UsbHandle() {
    if (handle_ != nullptr) libusb_close(handle_);
  }
  [[nodiscard]] libusb_device_handle* get() const { return handle_; }

 private:
  libusb_device_handle* handle_ = nullptr;
};

/// One chip that could be ours, opened if it may be.
struct UsbChip {
  FtdiDevice facts;
  UsbHandle handle;
};

/// All of them. @throws DeviceError when USB itself cannot be used.
std::vector<UsbChip> usb_chips(const UsbContext& context);

}  // namespace eigenpose
