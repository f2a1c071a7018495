#include "drivers/usb/ftdi_device.h"

#include <algorithm>
#include <array>
#include <memory>

#include <fmt/format.h>

#include "core/base/error.h"
#include "drivers/device_claim.h"
#include "drivers/usb/ftdi_baud.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t request_out =
    int{LIBUSB_REQUEST_TYPE_VENDOR} | int{LIBUSB_RECIPIENT_DEVICE} | int{LIBUSB_ENDPOINT_OUT};
constexpr std::uint8_t request_reset = 0;
constexpr std::uint8_t request_modem_control = 1;
constexpr std::uint8_t request_flow_control = 2;
constexpr std::uint8_t request_baud = 3;
constexpr std::uint8_t request_data = 4;
constexpr std::uint8_t request_latency = 9;
constexpr std::uint16_t reset_chip = 0;
constexpr std::uint16_t purge_receive = 1;
constexpr std::uint16_t purge_transmit = 2;
constexpr std::uint16_t dtr_on = 0x0101;
constexpr std::uint16_t rts_on = 0x0202;

constexpr int status_bytes = 2;               ///< in front of every packet
constexpr std::uint8_t overrun_error = 0x02;  ///< of the second status byte
constexpr std::uint8_t parity_error = 0x04;
constexpr std::uint8_t framing_error = 0x08;

constexpr unsigned control_timeout_ms = 1000;
/// A wait is cut into pieces, so that nothing depends on a lost event.
constexpr Duration longest_transfer = 250ms;
constexpr std::size_t packets_in_buffer = 8;

unsigned milliseconds(Duration timeout) {
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(std::min(timeout, longest_transfer)).count();
  return static_cast<unsigned>(std::max<std::int64_t>(1, ms));  // 0 would mean for ever
}

}  // namespace

FtdiLink::Device::Device(const FtdiLinkOptions& options, const std::string& name)
    : options_(options), name_(name) {
  find();
  libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
  const int claimed = libusb_claim_interface(handle_.get(), options_.interface);
  if (claimed == LIBUSB_ERROR_BUSY) throw DeviceError(name_, "open", std::string(held_by_another));
  check(claimed, "open");
  claimed_ = true;
  try {
    find_endpoints();
    set_up();
  } catch (...) {
    libusb_release_interface(handle_.get(), options_.interface);
    throw;
  }
}

FtdiLink::Device::~Device() {
  if (claimed_) libusb_release_interface(handle_.get(), options_.interface);
}

std::size_t FtdiLink::Device::send(std::span<const std::uint8_t> bytes, Duration timeout) {
  int sent = 0;
  const int result =
      libusb_bulk_transfer(handle_.get(), endpoint_out_, const_cast<std::uint8_t*>(bytes.data()),
                           static_cast<int>(bytes.size()), &sent, milliseconds(timeout));
  if (result != 0 && result != LIBUSB_ERROR_TIMEOUT) fail_at(endpoint_out_, result, "write");
  return static_cast<std::size_t>(sent);
}

void FtdiLink::Device::receive(Duration timeout) {
  int count = 0;
  const int result = libusb_bulk_transfer(handle_.get(), endpoint_in_, packets_.data(),
                                          static_cast<int>(packets_.size()), &count, milliseconds(timeout));
  if (result != 0 && result != LIBUSB_ERROR_TIMEOUT) fail_at(endpoint_in_, result, "read");
  std::uint8_t errors = 0;
  for (int start = 0; start + status_bytes <= count; start += packet_size_) {
    const int end = std::min(start + packet_size_, count);
    errors |= packets_[static_cast<std::size_t>(start) + 1];
    received_.insert(received_.end(), packets_.begin() + start + status_bytes, packets_.begin() + end);
  }
  if ((errors & overrun_error) != 0) damaged("bytes were lost in the chip: read more often");
  if ((errors & (parity_error | framing_error)) != 0) damaged("damaged bytes: is the baud rate right?");
}

std::size_t FtdiLink::Device::take(std::span<std::uint8_t> buffer) {
  const std::size_t count = std::min(buffer.size(), received_.size());
  const auto end = received_.begin() + static_cast<std::ptrdiff_t>(count);
  std::copy(received_.begin(), end, buffer.begin());
  received_.erase(received_.begin(), end);
  return count;
}

void FtdiLink::Device::discard() {
  received_.clear();
  control(request_reset, purge_receive, 0);
}

void FtdiLink::Device::damaged(const std::string& what) {
  received_.clear();
  throw DeviceError(name_, "read", what);
}

void FtdiLink::Device::fail_at(std::uint8_t endpoint, int result, const std::string& operation) const {
  if (result == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), endpoint);
  fail(result, operation);
}

void FtdiLink::Device::fail(int result, const std::string& operation) const {
  const std::string cause = libusb_strerror(static_cast<libusb_error>(result));
  switch (result) {
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
    case LIBUSB_ERROR_IO:
      throw DeviceLost(name_, operation, "unplugged (" + cause + ")");
    case LIBUSB_ERROR_PIPE:
      throw DeviceError(name_, operation, "the device refuses the request (stall)");
    case LIBUSB_ERROR_TIMEOUT:
      throw DeviceTimeout(name_, operation, "no answer on USB");
    case LIBUSB_ERROR_ACCESS:
      throw DeviceError(name_, operation,
                        "this user may not open it: install the udev rules and join the group they name");
    default:
      throw DeviceError(name_, operation, cause);
  }
}

void FtdiLink::Device::check(int result, const std::string& operation) const {
  if (result < 0) fail(result, operation);
}

void FtdiLink::Device::find() {
  std::vector<UsbChip> found = usb_chips(context_);
  const bool any_denied =
      std::any_of(found.begin(), found.end(), [](const UsbChip& c) { return !c.facts.accessible; });
  if (!options_.serial.empty())
    std::erase_if(found, [&](const UsbChip& c) { return c.facts.serial != options_.serial; });
  else
    std::erase_if(found, [](const UsbChip& c) { return !c.facts.accessible; });
  if (found.empty() && any_denied) fail(LIBUSB_ERROR_ACCESS, "open");
  if (found.empty()) throw DeviceLost(name_, "open", "not plugged in");
  if (found.size() > 1)
    throw DeviceError(name_, "open",
                      fmt::format("{} of them are plugged in; name one by its serial number", found.size()));
  handle_ = std::move(found.front().handle);
}

void FtdiLink::Device::find_endpoints() {
  libusb_config_descriptor* raw = nullptr;
  check(libusb_get_active_config_descriptor(libusb_get_device(handle_.get()), &raw), "open");
  const std::unique_ptr<libusb_config_descriptor, decltype(&libusb_free_config_descriptor)> config(
      raw, libusb_free_config_descriptor);
  if (options_.interface >= config->bNumInterfaces)
    throw DeviceError(name_, "open", fmt::format("it has no channel {}", options_.interface));
  const libusb_interface_descriptor& interface = config->interface[options_.interface].altsetting[0];
  for (int i = 0; i < interface.bNumEndpoints; ++i) {
    const libusb_endpoint_descriptor& endpoint = interface.endpoint[i];
    if ((endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
    if ((endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0) {
      endpoint_in_ = endpoint.bEndpointAddress;
      packet_size_ = endpoint.wMaxPacketSize;
    } else {
      endpoint_out_ = endpoint.bEndpointAddress;
    }
  }
  if (endpoint_in_ == 0 || endpoint_out_ == 0 || packet_size_ <= status_bytes)
    throw DeviceError(name_, "open", "it has not the endpoints of an FTDI chip");
  packets_.resize(static_cast<std::size_t>(packet_size_) * packets_in_buffer);
  several_channels_ = config->bNumInterfaces > 1;
}

void FtdiLink::Device::control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  // Chips with several channels count them from 1 in these requests.
  const auto channel = static_cast<std::uint16_t>(several_channels_ ? options_.interface + 1 : 0);
  check(libusb_control_transfer(handle_.get(), request_out, request, value,
                                static_cast<std::uint16_t>(index | channel), nullptr, 0, control_timeout_ms),
        "set up");
}

void FtdiLink::Device::set_up() {
  control(request_reset, reset_chip, 0);
  const ftdi::BaudDivisor divisor = ftdi::baud_divisor(options_.baud);
  control(request_baud, divisor.value,
          several_channels_ ? static_cast<std::uint16_t>(divisor.index << 8) : divisor.index);
  const int parity = options_.parity == 'O' ? 1 : options_.parity == 'E' ? 2 : 0;
  const int stop = options_.stop_bits == 2 ? 2 : 0;
  control(request_data, static_cast<std::uint16_t>(8 | parity << 8 | stop << 11), 0);
  const std::uint16_t flow = options_.flow_control == FtdiFlowControl::rts_cts    ? 0x0100
                             : options_.flow_control == FtdiFlowControl::xon_xoff ? 0x0400
                                                                                  : 0;
  constexpr std::uint16_t xon_and_xoff = 0x1311;
  control(request_flow_control, flow == 0x0400 ? xon_and_xoff : 0, flow);
  control(request_modem_control, dtr_on, 0);
  control(request_modem_control, rts_on, 0);
  control(request_latency, static_cast<std::uint16_t>(options_.latency.count()), 0);
  control(request_reset, purge_receive, 0);
  control(request_reset, purge_transmit, 0);
}

}  // namespace eigenpose
