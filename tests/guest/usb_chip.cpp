#include "tests/guest/usb_chip.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <poll.h>
#include <sys/mount.h>
#include <unistd.h>

namespace eigenpose::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::size_t packet = 64;  // full speed
constexpr auto latency = 5ms;       // after which a packet leaves, filled or not
const fs::path gadget = "/sys/kernel/config/usb_gadget/chip";
const fs::path endpoints = "/run/usb-chip";  // ep0: requests, ep1: to the host, ep2: from the host

[[noreturn]] void refuse(const std::string& what) {
  throw std::runtime_error("USB chip: " + what + ": " + std::strerror(errno));
}

void put(const fs::path& file, const std::string& value) {
  std::ofstream stream(file);
  stream << value << std::flush;
  if (!stream) refuse(file.string());
}

void mount_at(const char* source, const fs::path& folder, const char* type) {
  fs::create_directories(folder);
  if (mount(source, folder.c_str(), type, 0, nullptr) != 0 && errno != EBUSY) refuse(folder.string());
}

int open_endpoint(const char* name) {
  const int descriptor = open((endpoints / name).c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) refuse(name);
  return descriptor;
}

void put32(std::vector<std::uint8_t>& bytes, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

/// One interface with the two bulk endpoints of an FT232.
std::vector<std::uint8_t> descriptors() {
  constexpr std::array<std::uint8_t, 23> of_full_speed = {9, 4, 0,    0, 2,  0xFF, 0xFF, 0xFF,
                                                          0,  // interface 0: vendor's own class
                                                          7, 5, 0x81, 2, 64, 0,    0,   // bulk, to the host
                                                          7, 5, 0x02, 2, 64, 0,    0};  // bulk, from the host
  std::vector<std::uint8_t> bytes;
  put32(bytes, FUNCTIONFS_DESCRIPTORS_MAGIC_V2);
  put32(bytes, 16 + static_cast<std::uint32_t>(of_full_speed.size()));
  put32(bytes, FUNCTIONFS_HAS_FS_DESC | FUNCTIONFS_ALL_CTRL_RECIP);
  put32(bytes, 3);
  bytes.insert(bytes.end(), of_full_speed.begin(), of_full_speed.end());
  return bytes;
}

std::vector<std::uint8_t> no_strings() {
  std::vector<std::uint8_t> bytes;
  put32(bytes, FUNCTIONFS_STRINGS_MAGIC);
  put32(bytes, 16);
  put32(bytes, 0);
  put32(bytes, 0);
  return bytes;
}

void make_gadget(const std::string& serial) {
  mount_at("configfs", "/sys/kernel/config", "configfs");
  fs::create_directories(gadget / "strings/0x409");
  put(gadget / "idVendor", "0x0403");
  put(gadget / "idProduct", "0x6001");
  put(gadget / "bcdDevice", "0x0600");
  put(gadget / "strings/0x409/manufacturer", "Eigenpose");
  put(gadget / "strings/0x409/product", "FT232 in software");
  put(gadget / "strings/0x409/serialnumber", serial);
  fs::create_directories(gadget / "configs/c.1");
  fs::create_directories(gadget / "functions/ffs.chip");
  fs::create_directory_symlink(gadget / "functions/ffs.chip", gadget / "configs/c.1/ffs.chip");
  mount_at("chip", endpoints, "functionfs");
}

/// I/O against an endpoint's direction halts it.
void halt_to_host(int endpoint) {
  std::uint8_t nothing = 0;
  (void)!read(endpoint, &nothing, 1);
}
void halt_from_host(int endpoint) {
  const std::uint8_t nothing = 0;
  (void)!write(endpoint, &nothing, 1);
}

}  // namespace

UsbChip::UsbChip(std::string serial) : serial_(std::move(serial)) {
  make_gadget(serial_);
  control_ = open_endpoint("ep0");
  for (const auto& bytes : {descriptors(), no_strings()})
    if (write(control_, bytes.data(), bytes.size()) < 0) refuse("descriptors");
  to_host_ = open_endpoint("ep1");
  from_host_ = open_endpoint("ep2");
  threads_.emplace_back([this](const std::stop_token& stop) { serve_requests(stop); });
  threads_.emplace_back([this](const std::stop_token& stop) { serve_host_reads(stop); });
  threads_.emplace_back([this](const std::stop_token& stop) { serve_host_writes(stop); });
}

UsbChip::~UsbChip() {
  for (std::jthread& thread : threads_) thread.request_stop();
  unplug();  // ends what still waits for the host
  threads_.clear();
  for (const int descriptor : {to_host_, from_host_, control_}) close(descriptor);
}

void UsbChip::wire(sim::ByteDevice* device) {
  const std::lock_guard lock(mutex_);
  device_ = device;
  waiting_.clear();
}

void UsbChip::set_faults(const UsbChipFaults& faults) {
  const std::lock_guard lock(mutex_);
  faults_ = faults;
}

UsbChipFaults UsbChip::faults() const {
  const std::lock_guard lock(mutex_);
  return faults_;
}

void UsbChip::plug_in() {
  const std::lock_guard lock(plug_mutex_);
  if (plugged_) return;
  put(gadget / "UDC", "dummy_udc.0");
  plugged_ = true;
}

void UsbChip::unplug() {
  const std::lock_guard lock(plug_mutex_);
  if (!plugged_) return;
  put(gadget / "UDC", "\n");
  plugged_ = false;
  const std::lock_guard contents(mutex_);
  waiting_.clear();
}

void UsbChip::serve_requests(const std::stop_token& stop) {
  constexpr std::uint8_t get_modem_status = 5, get_latency = 0x0A, read_memory = 0x90;
  while (!stop.stop_requested()) {
    pollfd polled{control_, POLLIN, 0};
    if (poll(&polled, 1, 50) <= 0) continue;
    usb_functionfs_event event{};
    if (read(control_, &event, sizeof event) != sizeof event || event.type != FUNCTIONFS_SETUP) continue;
    const bool to_host = (event.u.setup.bRequestType & USB_DIR_IN) != 0;
    std::array<std::uint8_t, 2> answer{};
    std::size_t length = 0;
    switch (event.u.setup.bRequest) {
      case get_latency:
        answer = {16, 0};
        length = 1;
        break;
      case get_modem_status:
        answer = {0x01, 0x60};
        length = 2;
        break;
      case read_memory:
        answer = {0xFF, 0xFF};
        length = 2;
        break;
      default:
        break;
    }
    const bool refused = faults().refuses_requests || (to_host && length == 0);
    // Against the request's direction: a stall. With it: the answer, or the acknowledgement.
    if (to_host != refused)
      (void)!write(control_, answer.data(), std::min<std::size_t>(length, event.u.setup.wLength));
    else
      (void)!read(control_, answer.data(), 0);
  }
}

std::vector<std::uint8_t> UsbChip::next_packet(bool& last) {
  std::unique_lock lock(mutex_);
  if (device_ != nullptr) {
    const auto more = device_->spontaneous();
    if (!faults_.silent) waiting_.insert(waiting_.end(), more.begin(), more.end());
  }
  if (waiting_.empty()) news_.wait_for(lock, latency, [this] { return !waiting_.empty(); });
  if (faults_.headless_packets > 0) {
    --faults_.headless_packets;
    return std::vector<std::uint8_t>(faults_.headless_packets % 2 == 0 ? 0U : 1U, 0x01);
  }
  std::vector<std::uint8_t> bytes;
  bytes.reserve(packet);
  bytes.push_back(0x01);
  bytes.push_back(static_cast<std::uint8_t>(0x60 | std::exchange(faults_.line_errors, 0)));
  std::size_t count = std::min(packet - bytes.size(), waiting_.size());
  if (faults_.vanishes_after_sending >= 0) {
    count = std::min(count, static_cast<std::size_t>(faults_.vanishes_after_sending));
    faults_.vanishes_after_sending -= static_cast<int>(count);
    last = faults_.vanishes_after_sending == 0;
    if (last) faults_.vanishes_after_sending = -1;
  }
  const auto end = waiting_.begin() + static_cast<std::ptrdiff_t>(count);
  bytes.insert(bytes.end(), waiting_.begin(), end);
  waiting_.erase(waiting_.begin(), end);
  return bytes;
}

void UsbChip::serve_host_reads(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    bool halt = false;
    {
      const std::lock_guard lock(mutex_);
      if (faults_.stalled_reads > 0) {
        --faults_.stalled_reads;
        halt = true;
      }
    }
    if (halt) halt_to_host(to_host_);
    bool last = false;
    const std::vector<std::uint8_t> bytes = next_packet(last);
    // Waits for the host to read; fails while the chip is not plugged in.
    if (write(to_host_, bytes.data(), bytes.size()) < 0) std::this_thread::sleep_for(latency);
    if (last) {
      // The controller holds one packet that the host has not read yet; that one more goes in says that it
      // has.
      (void)!write(to_host_, bytes.data(), 2);
      unplug();
    }
  }
}

void UsbChip::serve_host_writes(const std::stop_token& stop) {
  std::array<std::uint8_t, packet> buffer{};
  while (!stop.stop_requested()) {
    if (faults().deaf) {
      std::this_thread::sleep_for(latency);
      continue;
    }
    const ssize_t count = read(from_host_, buffer.data(), buffer.size());
    if (count < 0) {
      std::this_thread::sleep_for(latency);
      continue;
    }
    bool last = false, halt = false;
    {
      const std::lock_guard lock(mutex_);
      if (faults_.vanishes_after_hearing >= 0) {
        faults_.vanishes_after_hearing =
            std::max(0, faults_.vanishes_after_hearing - static_cast<int>(count));
        last = faults_.vanishes_after_hearing == 0;
        if (last) faults_.vanishes_after_hearing = -1;
      }
      if (faults_.stalled_writes > 0) {
        --faults_.stalled_writes;
        halt = true;
      }
      if (device_ != nullptr && !faults_.silent) {
        const auto answer = device_->receive(std::span(buffer).first(static_cast<std::size_t>(count)));
        waiting_.insert(waiting_.end(), answer.begin(), answer.end());
      }
    }
    news_.notify_all();
    if (last) unplug();
    if (halt) halt_from_host(from_host_);
  }
}

}  // namespace eigenpose::test
