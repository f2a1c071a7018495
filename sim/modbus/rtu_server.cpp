#include "sim/modbus/rtu_server.h"

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "core/base/error.h"
#include "sim/lab/descriptor.h"

namespace eigenpose::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int line_wake_ms = 5;  // drives tick, late answers leave
/// A frame that is not whole after this long a silence was damaged; a pseudo-terminal may pause longer
/// than 3.5 characters.
constexpr Duration frame_gap = std::chrono::milliseconds(30);
constexpr std::size_t longest_frame = 256;

[[noreturn]] void refuse(const std::string& what) {
  throw Error("simulated RS-485 line: " + what + ": " + std::strerror(errno));
}

void make_raw(int terminal) {
  termios settings{};
  if (tcgetattr(terminal, &settings) != 0) refuse("no terminal settings");
  cfmakeraw(&settings);
  if (tcsetattr(terminal, TCSANOW, &settings) != 0) refuse("no terminal settings");
}

/// Bytes of the request that starts `bytes`, checksum included; nothing while that cannot be known.
std::optional<std::size_t> request_length(const Bytes& bytes) {
  if (bytes.size() < 2) return {};
  const auto counted = [&](std::size_t at) -> std::optional<std::size_t> {
    if (bytes.size() <= at) return {};
    return at + 1 + bytes[at] + 2;
  };
  switch (bytes[1]) {
    case 0x0F:
    case 0x10:
      return counted(6);
    case 0x17:
      return counted(10);
    default:
      return 8;  // unit, function, four bytes, checksum
  }
}

}  // namespace

std::uint16_t modbus_crc(std::span<const std::uint8_t> frame) {
  unsigned crc = 0xFFFF;
  for (const std::uint8_t byte : frame) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? (crc >> 1U) ^ 0xA001U : crc >> 1U;
  }
  return static_cast<std::uint16_t>(crc);
}

class SimRtuServer::Worker {
 public:
  Worker(SimLab& lab, SimRtuServerOptions options)
      : lab_(lab), options_(std::move(options)), pdus_(lab, options_.drives, options_.speed_factor) {
    plug_in();
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    thread_.request_stop();
    thread_.join();
    unplug();
  }

  void plug_in() {
    const std::lock_guard lock(mutex_);
    if (line_) return;
    Descriptor line(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!line || grantpt(line.get()) != 0 || unlockpt(line.get()) != 0) refuse("no pseudo-terminal");
    char name[128] = {};
    if (ptsname_r(line.get(), name, sizeof name) != 0) refuse("no pseudo-terminal");
    // Held open here too: otherwise the line would end whenever a driver closes its port.
    Descriptor far_end(::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC));
    if (!far_end) refuse(name);
    make_raw(far_end.get());
    std::error_code error;
    std::filesystem::remove(options_.port, error);
    std::filesystem::create_symlink(name, options_.port, error);
    if (error) throw Error("simulated RS-485 line: " + options_.port.string() + ": " + error.message());
    line_ = std::move(line);
    far_end_ = std::move(far_end);
    received_.clear();
    late_.clear();
  }

  void unplug() {
    const std::lock_guard lock(mutex_);
    line_.reset();
    far_end_.reset();
    std::error_code ignored;
    std::filesystem::remove(options_.port, ignored);
  }

  FaultPlan& faults() { return faults_; }
  PduServer& pdus() { return pdus_; }
  [[nodiscard]] std::uint64_t requests() const { return requests_; }
  void set_echo(bool echo) { echo_ = echo; }

 private:
  struct LateAnswer {
    TimePoint due;
    Bytes bytes;
  };

  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      int line = -1;
      {
        const std::lock_guard lock(mutex_);
        line = line_.get();
      }
      pollfd polled{line, POLLIN, 0};
      ::poll(&polled, 1, line_wake_ms);  // an unplugged line, −1, only sleeps
      pdus_.tick();
      const std::lock_guard lock(mutex_);
      if (!line_) continue;
      send_due_answers();
      receive();
    }
  }

  void receive() {
    const TimePoint now = lab_.clock().now();
    std::uint8_t chunk[512];
    for (;;) {
      const auto count = ::read(line_.get(), chunk, sizeof chunk);
      if (count <= 0) break;
      if (echo_) send(Bytes(chunk, chunk + count));
      received_.insert(received_.end(), chunk, chunk + count);
      last_byte_ = now;
    }
    while (take_request()) {
    }
    if (!received_.empty() && now - last_byte_ > frame_gap) received_.clear();
  }

  bool take_request() {
    const auto length = request_length(received_);
    if (length && *length > longest_frame) received_.clear();
    if (!length || received_.size() < *length) return false;
    const Bytes frame(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(*length));
    const std::uint16_t crc = modbus_crc(std::span(frame).first(*length - 2));
    if (frame[*length - 2] != (crc & 0xFFU) || frame[*length - 1] != crc >> 8U) {
      received_.clear();
      return false;
    }
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(*length));
    obey(frame);
    return true;
  }

  void obey(const Bytes& frame) {
    ++requests_;
    const std::uint8_t unit = frame[0];
    const std::span<const std::uint8_t> pdu(frame.data() + 1, frame.size() - 3);
    const WireFault fault = faults_.next();
    if (fault.kind == WireFaultKind::loss) return;
    std::optional<Bytes> answer;
    if (fault.kind == WireFaultKind::exception)
      answer = exception_answer(pdu[0], static_cast<ModbusException>(fault.exception_code));
    else
      answer = pdus_.serve(unit, pdu);
    if (!answer || fault.kind == WireFaultKind::silence) return;
    Bytes bytes = {fault.kind == WireFaultKind::wrong_unit ? static_cast<std::uint8_t>(unit + 1) : unit};
    bytes.insert(bytes.end(), answer->begin(), answer->end());
    const auto crc =
        static_cast<std::uint16_t>(modbus_crc(bytes) ^ (fault.kind == WireFaultKind::bad_crc ? 0x0101U : 0U));
    bytes.push_back(static_cast<std::uint8_t>(crc));
    bytes.push_back(static_cast<std::uint8_t>(crc >> 8U));
    if (fault.kind == WireFaultKind::partial) bytes.resize(bytes.size() / 2);
    if (fault.kind == WireFaultKind::late)
      late_.push_back({lab_.clock().now() + fault.delay, std::move(bytes)});
    else
      send(bytes);
  }

  void send(const Bytes& bytes) const {
    [[maybe_unused]] const auto sent = ::write(line_.get(), bytes.data(), bytes.size());
  }

  void send_due_answers() {
    std::erase_if(late_, [&](const LateAnswer& answer) {
      const bool due = answer.due <= lab_.clock().now();
      if (due) send(answer.bytes);
      return due;
    });
  }

  SimLab& lab_;
  const SimRtuServerOptions options_;
  PduServer pdus_;
  FaultPlan faults_;
  std::atomic<std::uint64_t> requests_{0};
  std::atomic<bool> echo_{false};
  std::mutex mutex_;
  Descriptor line_;               ///< guarded by mutex_: our end
  Descriptor far_end_;            ///< guarded by mutex_: the end that drivers open
  Bytes received_;                ///< guarded by mutex_
  TimePoint last_byte_;           ///< guarded by mutex_
  std::vector<LateAnswer> late_;  ///< guarded by mutex_
  std::jthread thread_;           // last: it ends before what it uses
};

SimRtuServer::SimRtuServer(SimLab& lab, SimRtuServerOptions options)
    : worker_(std::make_unique<Worker>(lab, std::move(options))) {}
SimRtuServer::~SimRtuServer() = default;

FaultPlan& SimRtuServer::faults() {
  return worker_->faults();
}
AzDrive& SimRtuServer::drive(std::uint8_t unit) {
  return worker_->pdus().drive(unit);
}
std::uint64_t SimRtuServer::requests() const {
  return worker_->requests();
}
void SimRtuServer::set_echo(bool echo) {
  worker_->set_echo(echo);
}
void SimRtuServer::unplug() {
  worker_->unplug();
}
void SimRtuServer::plug_in() {
  worker_->plug_in();
}

}  // namespace eigenpose::sim
