#include "daemon/api/client/local_stream.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/base/error.h"
#include "daemon/api/client/local_address.h"

namespace eigenpose {
namespace {

boost::system::error_code last_error() {
  return {errno, boost::system::generic_category()};
}

}  // namespace

LocalStream::LocalStream(const std::filesystem::path& socket) {
  const sockaddr_un address = local_address(socket);
  socket_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  // The kernel takes or refuses a local connection at once.
  const bool connected =
      socket_ >= 0 && ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  if (connected) wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake_ >= 0) return;
  const int cause = errno;
  if (socket_ >= 0) ::close(socket_);
  if (cause == EACCES)
    throw FileError(
        socket,
        "this user may not use this socket; join the group that owns it, or use results.sock for reading");
  throw FileError(socket, std::string("no eigenposed answers there (") + std::strerror(cause) +
                              "); start it, or give the path of its socket");
}

LocalStream::~LocalStream() {
  ::close(socket_);
  ::close(wake_);
}

void LocalStream::expires_after(std::chrono::milliseconds timeout) {
  deadline_ = std::chrono::steady_clock::now() + timeout;
}

void LocalStream::cancel() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written =
      ::write(wake_, &one, sizeof one);  // fails only when it is set already
}

bool LocalStream::wait_for(short events, boost::system::error_code& error) const {
  std::array<pollfd, 2> polled{{{socket_, events, 0}, {wake_, POLLIN, 0}}};
  for (;;) {
    int patience = -1;
    if (deadline_) {
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(*deadline_ - std::chrono::steady_clock::now());
      patience = static_cast<int>(std::max<std::int64_t>(0, left.count()));
    }
    const int ready = ::poll(polled.data(), polled.size(), patience);
    if (ready < 0 && errno == EINTR) continue;
    if (ready < 0) error = last_error();
    if (ready == 0) error = make_error_code(boost::system::errc::timed_out);
    if (ready > 0 && polled[1].revents != 0) error = make_error_code(boost::system::errc::operation_canceled);
    return !error;
  }
}

std::size_t LocalStream::read_bytes(void* data, std::size_t size, boost::system::error_code& error) {
  error = {};
  while (wait_for(POLLIN, error)) {
    const auto count = ::recv(socket_, data, size, MSG_DONTWAIT);
    if (count > 0) return static_cast<std::size_t>(count);
    if (count == 0) {
      error = boost::asio::error::eof;
    } else if (errno != EINTR && errno != EAGAIN) {
      error = last_error();
    }
    if (error) break;
  }
  return 0;
}

std::size_t LocalStream::write_bytes(const void* data, std::size_t size, boost::system::error_code& error) {
  error = {};
  while (wait_for(POLLOUT, error)) {
    const auto count = ::send(socket_, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR && errno != EAGAIN) {
      error = last_error();
      break;
    }
  }
  return 0;
}

}  // namespace eigenpose
