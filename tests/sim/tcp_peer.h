#pragma once

/// A bare TCP connection for tests that look at single bytes.

#include <cstdint>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include "sim/lab/descriptor.h"

namespace eigenpose::sim {

using Bytes = std::vector<std::uint8_t>;

class TcpPeer {
 public:
  explicit TcpPeer(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  [[nodiscard]] bool connected() const { return connected_; }
  void send(const Bytes& bytes) const { ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// Up to `count` bytes; fewer when the other side closes or nothing more comes within `patience_ms`.
  [[nodiscard]] Bytes receive(std::size_t count, int patience_ms = 5000) const {
    Bytes bytes;
    while (bytes.size() < count) {
      pollfd polled{socket_.get(), POLLIN, 0};
      if (::poll(&polled, 1, patience_ms) <= 0) break;
      std::uint8_t byte = 0;
      if (::recv(socket_.get(), &byte, 1, 0) != 1) break;
      bytes.push_back(byte);
    }
    return bytes;
  }
  /// Waits for the other side to close. @return false when bytes come, or nothing happens for 5 s.
  [[nodiscard]] bool closed() const {
    pollfd polled{socket_.get(), POLLIN, 0};
    std::uint8_t byte = 0;
    return ::poll(&polled, 1, 5000) == 1 && ::recv(socket_.get(), &byte, 1, 0) <= 0;
  }
  [[nodiscard]] Bytes ask(const Bytes& request, std::size_t answer_size) const {
    send(request);
    return receive(answer_size);
  }

 private:
  Descriptor socket_;
  bool connected_ = false;
};

}  // namespace eigenpose::sim
