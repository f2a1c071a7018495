#include "daemon/service/state_lock.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// The number in the lock file, for the message; empty if there is none yet.
std::string holder_of(int descriptor) {
  std::array<char, 32> text{};
  const ssize_t count = ::pread(descriptor, text.data(), text.size(), 0);
  std::string number;
  for (ssize_t i = 0; i < count; ++i) {
    const char digit = text[static_cast<std::size_t>(i)];
    if (digit < '0' || digit > '9') break;
    number += digit;
  }
  return number;
}

}  // namespace

StateLock::StateLock(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "lock";
  descriptor_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
  if (descriptor_ < 0) throw FileError(file, std::string("cannot be opened: ") + std::strerror(errno));
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) {
    const std::string number = std::to_string(::getpid()) + "\n";
    // Only the message of another process needs the number.
    if (::ftruncate(descriptor_, 0) == 0) [[maybe_unused]]
      const ssize_t written = ::pwrite(descriptor_, number.data(), number.size(), 0);
    return;
  }
  const int cause = errno;
  const std::string holder = holder_of(descriptor_);
  ::close(descriptor_);
  if (cause != EWOULDBLOCK) throw FileError(file, std::string("cannot be locked: ") + std::strerror(cause));
  throw FileError(folder, "another eigenposed" + (holder.empty() ? "" : " (process " + holder + ")") +
                              " keeps its state there: stop it, or give this one another state_dir");
}

StateLock::~StateLock() {
  ::close(descriptor_);
}

}  // namespace eigenpose
