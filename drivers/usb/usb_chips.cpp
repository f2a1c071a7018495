#include "drivers/usb/usb_chips.h"

#include <algorithm>
#include <array>
#include <string>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {

namespace {

/// FT232R and B, FT2232, FT4232H, FT232H, FT-X, and Thorlabs's own number for APT controllers.
constexpr std::array<std::uint16_t, 6> products = {0x6001, 0x6010, 0x6011, 0x6014, 0x6015, 0xFAF0};

class DeviceList {
 public:
  explicit DeviceList(const UsbContext& context) {
    const ssize_t count = libusb_get_device_list(context.get(), &list_);
    if (count < 0)
      throw DeviceError("USB", "list devices", libusb_strerror(static_cast<libusb_error>(count)));
    devices_ = {list_, static_cast<std::size_t>(count)};
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  ~DeviceList() { libusb_free_device_list(list_, 1); }
  [[nodiscard]] std::span<libusb_device*> devices() const { return devices_; }

 private:
  libusb_device** list_ = nullptr;
  std::span<libusb_device*> devices_;
};

std::string text_of(const UsbHandle& handle, std::uint8_t index) {
  std::array<unsigned char, 128> text{};
  if (index == 0) return {};
  const int length =
      libusb_get_string_descriptor_ascii(handle.get(), index, text.data(), static_cast<int>(text.size()));
  return length > 0 ? std::string(text.begin(), text.begin() + length) : std::string();
}

std::string bus_path_of(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string path = fmt::format("{}", libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i)
    path += fmt::format("{}{}", i == 0 ? '-' : '.', ports[static_cast<std::size_t>(i)]);
  return path;
}

bool is_candidate(const libusb_device_descriptor& descriptor) {
  return descriptor.idVendor == vendor_ftdi &&
         std::find(products.begin(), products.end(), descriptor.idProduct) != products.end();
}

}  // namespace

UsbContext::UsbContext() {
  const int result = libusb_init(&context_);
  if (result != 0) throw DeviceError("USB", "start", libusb_strerror(static_cast<libusb_error>(result)));
}

std::vector<UsbChip> usb_chips(const UsbContext& context) {
  std::vector<UsbChip> found;
  const DeviceList list(context);
  for (libusb_device* device : list.devices()) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) != 0 || !is_candidate(descriptor)) continue;
    UsbChip chip;
    chip.facts.vendor = descriptor.idVendor;
    chip.facts.product = descriptor.idProduct;
    chip.facts.bus_path = bus_path_of(device);
    libusb_device_handle* opened = nullptr;
    chip.facts.accessible = libusb_open(device, &opened) == 0;
    if (chip.facts.accessible) {
      chip.handle = UsbHandle(opened);
      chip.facts.serial = text_of(chip.handle, descriptor.iSerialNumber);
      chip.facts.name = text_of(chip.handle, descriptor.iProduct);
    }
    found.push_back(std::move(chip));
  }
  return found;
}

std::vector<FtdiDevice> list_ftdi_devices() {
  const UsbContext context;
  std::vector<FtdiDevice> devices;
  for (const UsbChip& chip : usb_chips(context)) devices.push_back(chip.facts);
  return devices;
}

}  // namespace eigenpose
