#include "tests/guest/far_end.h"

#include <array>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

namespace eigenpose::test {
namespace {

constexpr int wake_ms = 5;  // devices speak by themselves

int open_raw(const std::string& path) {
  const int port = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (port < 0) throw std::runtime_error(path + " cannot be opened");
  termios settings{};
  tcgetattr(port, &settings);
  cfmakeraw(&settings);
  cfsetspeed(&settings, B115200);
  settings.c_cflag |= CLOCAL | CREAD;
  tcsetattr(port, TCSANOW, &settings);
  tcflush(port, TCIOFLUSH);
  return port;
}

void write_all(int port, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(port, bytes.data(), bytes.size());
    if (count > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
      continue;
    }
    pollfd room{port, POLLOUT, 0};
    if (poll(&room, 1, 100) <= 0) return;  // nobody listens: an unplugged chip
  }
}

}  // namespace

FarEnd::FarEnd(sim::ByteDevice& device) : device_(device), port_(open_raw("/dev/ttyS1")) {
  thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
}

FarEnd::~FarEnd() {
  thread_.request_stop();
  thread_.join();
  close(port_);
}

void FarEnd::serve(const std::stop_token& stop) {
  std::array<std::uint8_t, 256> buffer{};
  while (!stop.stop_requested()) {
    pollfd polled{port_, POLLIN, 0};
    if (poll(&polled, 1, wake_ms) > 0) {
      const ssize_t count = read(port_, buffer.data(), buffer.size());
      if (count > 0)
        write_all(port_, device_.receive(std::span(buffer).first(static_cast<std::size_t>(count))));
    }
    write_all(port_, device_.spontaneous());
  }
}

Terminal::Terminal(const std::string& path) : port_(open_raw(path)) {}

Terminal::~Terminal() {
  close(port_);
}

std::vector<std::uint8_t> Terminal::receive(std::span<const std::uint8_t> bytes) {
  write_all(port_, bytes);
  return {};
}

std::vector<std::uint8_t> Terminal::spontaneous() {
  std::array<std::uint8_t, 256> buffer{};
  const ssize_t count = read(port_, buffer.data(), buffer.size());
  if (count <= 0) return {};
  return {buffer.begin(), buffer.begin() + count};
}

}  // namespace eigenpose::test
