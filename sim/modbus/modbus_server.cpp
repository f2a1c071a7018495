#include "sim/modbus/modbus_server.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <list>
#include <mutex>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/base/error.h"
#include "sim/lab/descriptor.h"

namespace eigenpose::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t header_size = 7;
constexpr std::size_t longest_pdu = 253;
constexpr int wake_ms = 10;  // drives tick, late answers leave
constexpr std::size_t most_connections = 16;

std::string cause() {
  return std::strerror(errno);
}

}  // namespace

class SimModbusServer::Worker {
 public:
  Worker(SimLab& lab, const SimModbusServerOptions& options)
      : lab_(lab),
        pdus_(lab, options.drives, options.speed_factor),
        wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (!wake_) throw Error("simulated Modbus server: no event descriptor: " + cause());
    port_ = options.port;
    listener_ = listen();
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    thread_.request_stop();
    wake();
  }

  void die() {
    const std::lock_guard lock(mutex_);
    close_all();
    wake();
  }

  void die_at(TimePoint when) {
    const std::lock_guard lock(mutex_);
    death_ = when;
  }

  void revive() {
    const std::lock_guard lock(mutex_);
    death_ = TimePoint::max();
    if (!listener_) listener_ = listen();
    wake();
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::uint64_t requests() const { return requests_; }
  FaultPlan& faults() { return faults_; }
  PduServer& pdus() { return pdus_; }

 private:
  struct Connection {
    std::uint64_t id;
    Descriptor socket;
    Bytes received;
    bool broken = false;
  };
  struct LateAnswer {
    TimePoint due;
    std::uint64_t connection;  ///< may be gone by then
    Bytes bytes;
  };

  void wake() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
  }

  Descriptor listen() {
    Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int yes = 1;
    if (socket) setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port_);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    if (!socket || bind(socket.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(socket.get(), 8) != 0 ||
        getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &length) != 0) {
      throw Error("simulated Modbus server: cannot listen on 127.0.0.1 port " + std::to_string(port_) + ": " +
                  cause() + "; choose another port, or 0 for a free one");
    }
    port_ = ntohs(address.sin_port);
    return socket;
  }

  void close_all() {
    listener_.reset();
    connections_.clear();
    late_.clear();
  }

  void run(const std::stop_token& stop) {
    std::vector<pollfd> polled;
    while (!stop.stop_requested()) {
      polled.clear();
      polled.push_back({wake_.get(), POLLIN, 0});
      {
        const std::lock_guard lock(mutex_);
        if (listener_) polled.push_back({listener_.get(), POLLIN, 0});
        for (const Connection& connection : connections_)
          polled.push_back({connection.socket.get(), POLLIN, 0});
      }
      ::poll(polled.data(), polled.size(), wake_ms);
      std::uint64_t ignored = 0;
      [[maybe_unused]] const auto drained = ::read(wake_.get(), &ignored, sizeof ignored);
      pdus_.tick();
      const std::lock_guard lock(mutex_);
      if (lab_.clock().now() >= death_) {
        death_ = TimePoint::max();
        close_all();
      }
      send_due_answers();
      // Sockets do not block, so it does no harm to look at all of them.
      for (Connection& connection : connections_) receive(connection);
      std::erase_if(connections_, [](const Connection& c) { return c.broken; });
      if (dying_) {
        dying_ = false;
        close_all();
      }
      accept_new();
    }
  }

  void accept_new() {
    while (listener_) {
      Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (!socket) return;
      if (connections_.size() >= most_connections) continue;
      const int yes = 1;
      setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
      connections_.push_back({next_connection_++, std::move(socket), {}, false});
    }
  }

  void receive(Connection& connection) {
    std::uint8_t chunk[512];
    for (;;) {
      const auto count = ::recv(connection.socket.get(), chunk, sizeof chunk, 0);
      if (count > 0) {
        connection.received.insert(connection.received.end(), chunk, chunk + count);
        continue;
      }
      if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) connection.broken = true;
      break;
    }
    // Requests that came before the other side closed are still obeyed.
    while (!dying_ && take_request(connection)) {
    }
  }

  /// @return false when there is no whole request any more.
  bool take_request(Connection& connection) {
    Bytes& bytes = connection.received;
    if (bytes.size() < header_size) return false;
    const std::size_t length = static_cast<std::size_t>(bytes[4]) << 8U | bytes[5];
    if (length < 2 || length > longest_pdu + 1) {
      connection.broken = true;  // where the next message starts can't be known
      return false;
    }
    if (bytes.size() < 6 + length) return false;
    const Bytes message(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(6 + length));
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(6 + length));
    const bool modbus = message[2] == 0 && message[3] == 0;
    if (modbus) obey(connection, message);
    return !connection.broken;
  }

  void obey(Connection& connection, const Bytes& message) {
    ++requests_;
    const std::uint8_t unit = message[6];
    const std::span<const std::uint8_t> pdu(message.data() + header_size, message.size() - header_size);
    const WireFault fault = faults_.next();
    switch (fault.kind) {
      case WireFaultKind::loss:
        return;
      case WireFaultKind::close_connection:
        connection.broken = true;
        return;
      case WireFaultKind::death:
        dying_ = true;
        return;
      default:
        break;
    }
    std::optional<Bytes> answer;
    if (fault.kind == WireFaultKind::exception) {
      answer = exception_answer(pdu[0], static_cast<ModbusException>(fault.exception_code));
    } else {
      answer = pdus_.serve(unit, pdu);
      if (!answer && unit != 0) answer = exception_answer(pdu[0], ModbusException::gateway_target_silent);
    }
    if (!answer || fault.kind == WireFaultKind::silence) return;
    Bytes frame(message.begin(), message.begin() + 4);
    frame.push_back(0);
    frame.push_back(static_cast<std::uint8_t>(answer->size() + 1));
    frame.push_back(unit);
    frame.insert(frame.end(), answer->begin(), answer->end());
    if (fault.kind == WireFaultKind::wrong_unit) frame[6] = static_cast<std::uint8_t>(unit + 1);
    if (fault.kind == WireFaultKind::wrong_transaction) frame[1] = static_cast<std::uint8_t>(frame[1] + 1);
    if (fault.kind == WireFaultKind::partial) frame.resize(frame.size() / 2);
    if (fault.kind == WireFaultKind::late) {
      late_.push_back({lab_.clock().now() + fault.delay, connection.id, std::move(frame)});
      return;
    }
    send(connection, frame);
  }

  static void send(Connection& connection, const Bytes& frame) {
    const auto sent = ::send(connection.socket.get(), frame.data(), frame.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(frame.size())) connection.broken = true;
  }

  void send_due_answers() {
    const TimePoint now = lab_.clock().now();
    for (auto answer = late_.begin(); answer != late_.end();) {
      if (answer->due > now) {
        ++answer;
        continue;
      }
      const auto to = std::find_if(connections_.begin(), connections_.end(),
                                   [&](const Connection& c) { return c.id == answer->connection; });
      if (to != connections_.end()) send(*to, answer->bytes);
      answer = late_.erase(answer);
    }
  }

  SimLab& lab_;
  PduServer pdus_;
  FaultPlan faults_;
  Descriptor wake_;
  std::atomic<std::uint16_t> port_{0};
  std::atomic<std::uint64_t> requests_{0};
  std::mutex mutex_;
  Descriptor listener_;                 ///< guarded by mutex_
  std::list<Connection> connections_;   ///< guarded by mutex_
  std::vector<LateAnswer> late_;        ///< guarded by mutex_
  std::uint64_t next_connection_ = 0;   ///< guarded by mutex_
  TimePoint death_ = TimePoint::max();  ///< guarded by mutex_
  bool dying_ = false;                  ///< guarded by mutex_
  std::jthread thread_;                 // last: it ends before what it uses
};

SimModbusServer::SimModbusServer(SimLab& lab, const SimModbusServerOptions& options)
    : worker_(std::make_unique<Worker>(lab, options)) {}
SimModbusServer::~SimModbusServer() = default;

std::uint16_t SimModbusServer::port() const {
  return worker_->port();
}
FaultPlan& SimModbusServer::faults() {
  return worker_->faults();
}
AzDrive& SimModbusServer::drive(std::uint8_t unit) {
  return worker_->pdus().drive(unit);
}
std::vector<std::uint8_t> SimModbusServer::units() const {
  return worker_->pdus().units();
}
std::uint64_t SimModbusServer::requests() const {
  return worker_->requests();
}
void SimModbusServer::die() {
  worker_->die();
}
void SimModbusServer::die_at(TimePoint when) {
  worker_->die_at(when);
}
void SimModbusServer::revive() {
  worker_->revive();
}

}  // namespace eigenpose::sim
