#include "drivers/device_claim.h"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {

std::optional<DeviceClaim> DeviceClaim::make(std::string name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // The first byte stays 0: the name is abstract, no path. A long one is told from others by its end.
  std::string label = "eigenpose device " + name;
  constexpr std::size_t room = sizeof(address.sun_path) - 1;
  if (label.size() > room) label.erase(0, label.size() - room);
  std::copy(label.begin(), label.end(), address.sun_path + 1);
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + label.size());

  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) throw Error(name + ": cannot be claimed: " + std::strerror(errno));
  DeviceClaim claim(std::move(name), descriptor);
  if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), length) == 0) return claim;
  if (errno == EADDRINUSE) return std::nullopt;
  throw Error(claim.name() + ": cannot be claimed: " + std::strerror(errno));
}

DeviceClaim::DeviceClaim(DeviceClaim&& other) noexcept
    : name_(std::move(other.name_)), socket_(std::exchange(other.socket_, -1)) {}

DeviceClaim& DeviceClaim::operator=(DeviceClaim&& other) noexcept {
  std::swap(name_, other.name_);
  std::swap(socket_, other.socket_);
  return *this;
}

DeviceClaim::~DeviceClaim() {
  if (socket_ >= 0) ::close(socket_);
}

}  // namespace eigenpose
