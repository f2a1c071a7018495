#include "daemon/api/client/local_address.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <sys/socket.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {

sockaddr_un local_address(const std::filesystem::path& socket) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& name = socket.native();
  if (name.size() >= sizeof(address.sun_path))
    throw FileError(socket, "too long for a socket (" + std::to_string(name.size()) + " bytes, at most " +
                                std::to_string(sizeof(address.sun_path) - 1) +
                                "): choose a shorter runtime_dir");
  std::memcpy(address.sun_path, name.c_str(), name.size() + 1);
  return address;
}

bool is_answered(const std::filesystem::path& socket) {
  const sockaddr_un address = local_address(socket);
  const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) throw FileError(socket, std::string("cannot be tried: ") + std::strerror(errno));
  const int result = ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  const int error = result == 0 ? 0 : errno;
  ::close(probe);
  // Only a refused connection or a missing file says that nobody listens; anything else (a full queue, no
  // permission) is a live socket.
  return error != ECONNREFUSED && error != ENOENT;
}

}  // namespace eigenpose
