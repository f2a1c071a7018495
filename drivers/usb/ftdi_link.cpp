#include "drivers/usb/ftdi_link.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <libusb-1.0/libusb.h>
#include <sys/time.h>

#include "core/base/error.h"
#include "drivers/device_claim.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t vendor_ftdi = 0x0403;
/// FT232R and B, FT2232, FT4232H, FT232H, FT-X, and Thorlabs's own number for APT controllers.
constexpr std::array<std::uint16_t, 6> products = {0x6001, 0x6010, 0x6011, 0x6014, 0x6015, 0xFAF0};

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
constexpr Duration longest_transfer =
    250ms;  ///< a wait is cut into pieces, so that nothing depends on a lost event
constexpr Duration look_again = 100ms;  ///< between two looks for a device that is gone
constexpr std::size_t packets_in_buffer = 8;

/// libusb's own state. One for each link, so that links live on threads of their own.
class UsbContext {
 public:
  UsbContext() {
    const int result = libusb_init(&context_);
    if (result != 0) throw DeviceError("USB", "start", libusb_strerror(static_cast<libusb_error>(result)));
  }
  UsbContext(const UsbContext&) = delete;
  UsbContext& operator=(const UsbContext&) = delete;
  ~UsbContext() { libusb_exit(context_); }
  [[nodiscard]] libusb_context* get() const { return context_; }

 private:
  libusb_context* context_ = nullptr;
};

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

class Handle {
 public:
  Handle() = default;
  explicit Handle(libusb_device_handle* handle) : handle_(handle) {}
  Handle(Handle&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Handle() {
    if (handle_ != nullptr) libusb_close(handle_);
  }
  [[nodiscard]] libusb_device_handle* get() const { return handle_; }

 private:
  libusb_device_handle* handle_ = nullptr;
};

std::string text_of(const Handle& handle, std::uint8_t index) {
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

/// One chip of the list, opened if it may be.
struct Candidate {
  FtdiDevice facts;
  Handle handle;
  int open_result = 0;
};

std::vector<Candidate> candidates(const UsbContext& context) {
  std::vector<Candidate> found;
  const DeviceList list(context);
  for (libusb_device* device : list.devices()) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) != 0 || !is_candidate(descriptor)) continue;
    Candidate candidate;
    candidate.facts.vendor = descriptor.idVendor;
    candidate.facts.product = descriptor.idProduct;
    candidate.facts.bus_path = bus_path_of(device);
    libusb_device_handle* opened = nullptr;
    candidate.open_result = libusb_open(device, &opened);
    candidate.facts.accessible = candidate.open_result == 0;
    if (candidate.open_result == 0) {
      candidate.handle = Handle(opened);
      candidate.facts.serial = text_of(candidate.handle, descriptor.iSerialNumber);
      candidate.facts.name = text_of(candidate.handle, descriptor.iProduct);
    }
    found.push_back(std::move(candidate));
  }
  return found;
}

}  // namespace

std::vector<FtdiDevice> list_ftdi_devices() {
  const UsbContext context;
  std::vector<FtdiDevice> devices;
  for (const Candidate& candidate : candidates(context)) devices.push_back(candidate.facts);
  return devices;
}

namespace {

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

/// An open, claimed and set up chip. Gives the kernel its driver back in the destructor.
class FtdiLink::Device {
 public:
  Device(const FtdiLinkOptions& options, const std::string& name) : options_(options), name_(name) {
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
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device() {
    if (claimed_) libusb_release_interface(handle_.get(), options_.interface);
  }

  /// @return bytes taken by the device; fewer than given when `timeout` ran out.
  std::size_t send(std::span<const std::uint8_t> bytes, Duration timeout) {
    int sent = 0;
    const int result =
        libusb_bulk_transfer(handle_.get(), endpoint_out_, const_cast<std::uint8_t*>(bytes.data()),
                             static_cast<int>(bytes.size()), &sent, milliseconds(timeout));
    if (result != 0 && result != LIBUSB_ERROR_TIMEOUT) fail_at(endpoint_out_, result, "write");
    return static_cast<std::size_t>(sent);
  }

  /// One transfer into the queue of received bytes. @throws DeviceError on an error the chip reports.
  void receive(Duration timeout) {
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

  std::size_t take(std::span<std::uint8_t> buffer) {
    const std::size_t count = std::min(buffer.size(), received_.size());
    const auto end = received_.begin() + static_cast<std::ptrdiff_t>(count);
    std::copy(received_.begin(), end, buffer.begin());
    received_.erase(received_.begin(), end);
    return count;
  }

  void discard() {
    received_.clear();
    control(request_reset, purge_receive, 0);
  }

 private:
  static unsigned milliseconds(Duration timeout) {
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(std::min(timeout, longest_transfer)).count();
    return static_cast<unsigned>(std::max<std::int64_t>(1, ms));  // 0 would mean for ever
  }

  [[noreturn]] void damaged(const std::string& what) {
    received_.clear();
    throw DeviceError(name_, "read", what);
  }

  /// A halted endpoint refuses everything until it is told to go on; so the next call finds it ready.
  [[noreturn]] void fail_at(std::uint8_t endpoint, int result, const std::string& operation) const {
    if (result == LIBUSB_ERROR_PIPE) libusb_clear_halt(handle_.get(), endpoint);
    fail(result, operation);
  }

  [[noreturn]] void fail(int result, const std::string& operation) const {
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

  void check(int result, const std::string& operation) const {
    if (result < 0) fail(result, operation);
  }

  void find() {
    std::vector<Candidate> found = candidates(context_);
    const bool any_denied =
        std::any_of(found.begin(), found.end(), [](const Candidate& c) { return !c.facts.accessible; });
    if (!options_.serial.empty())
      std::erase_if(found, [&](const Candidate& c) { return c.facts.serial != options_.serial; });
    else
      std::erase_if(found, [](const Candidate& c) { return !c.facts.accessible; });
    if (found.empty() && any_denied) fail(LIBUSB_ERROR_ACCESS, "open");
    if (found.empty()) throw DeviceLost(name_, "open", "not plugged in");
    if (found.size() > 1)
      throw DeviceError(
          name_, "open",
          fmt::format("{} of them are plugged in; name one by its serial number", found.size()));
    handle_ = std::move(found.front().handle);
  }

  void find_endpoints() {
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

  void control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
    // Chips with several channels count them from 1 in these requests.
    const auto channel = static_cast<std::uint16_t>(several_channels_ ? options_.interface + 1 : 0);
    check(
        libusb_control_transfer(handle_.get(), request_out, request, value,
                                static_cast<std::uint16_t>(index | channel), nullptr, 0, control_timeout_ms),
        "set up");
  }

  void set_up() {
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

  const FtdiLinkOptions& options_;
  const std::string& name_;
  UsbContext context_;
  Handle handle_;
  bool claimed_ = false;
  bool several_channels_ = false;
  std::uint8_t endpoint_in_ = 0;
  std::uint8_t endpoint_out_ = 0;
  int packet_size_ = 0;
  std::vector<std::uint8_t> packets_;
  std::deque<std::uint8_t> received_;
};

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

namespace ftdi {

BaudDivisor baud_divisor(int baud) {
  constexpr double clock_hz = 3e6;
  constexpr double largest_error = 0.03;
  // Eighths are coded in an order of their own; 1.0 and 1.5 have numbers of their own, and nothing lies
  // between.
  constexpr std::array<std::uint16_t, 8> eighths_code = {0, 3, 2, 4, 1, 5, 6, 7};
  const auto refuse = [&] {
    throw std::invalid_argument(fmt::format("baud rate {} cannot be made; 184 … 3000000 can", baud));
  };
  if (baud <= 0) refuse();
  const int eighths = static_cast<int>(std::lround(8.0 * clock_hz / baud));
  BaudDivisor divisor;
  if (eighths < 10) {
    divisor = {0, 0, clock_hz};
  } else if (eighths < 14) {
    divisor = {1, 0, clock_hz / 1.5};
  } else {
    const int steps = std::max(eighths, 16);
    if (steps >> 3 > 0x3FFF) refuse();
    const std::uint16_t code = eighths_code[static_cast<std::size_t>(steps & 7)];
    divisor = {static_cast<std::uint16_t>(steps >> 3 | (code & 3) << 14),
               static_cast<std::uint16_t>(code >> 2), 8.0 * clock_hz / steps};
  }
  if (std::abs(divisor.baud - baud) > largest_error * baud) refuse();
  return divisor;
}

}  // namespace ftdi

}  // namespace eigenpose
