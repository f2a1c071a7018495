#include "core/base/scratch_file.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/base/atomic_file.h"
#include "core/base/error.h"

namespace eigenpose {

ScratchFile::ScratchFile(const std::filesystem::path& folder, std::uintmax_t size)
    : folder_(folder.empty() ? std::filesystem::temp_directory_path() : folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder_, error);
  if (!error && space.available < size)
    throw FileError(folder_, "has " + std::to_string(space.available >> 20) +
                                 " MiB free, but views that do not fit into "
                                 "memory take " +
                                 std::to_string((size >> 20) + 1) +
                                 " MiB; make room or raise the memory limit");
  std::string name = (folder_ / ".eigenpose-scratch-XXXXXX").string();
  fd_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd_ < 0)
    throw FileError(folder_, std::string("a scratch file cannot be made: ") + write_trouble(errno));
  ::unlink(name.c_str());
}

ScratchFile::~ScratchFile() {
  ::close(fd_);
}

void ScratchFile::write(std::uintmax_t at, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0)
      throw FileError(folder_,
                      "its scratch file cannot be written: " + write_trouble(n < 0 ? errno : ENOSPC));
    at += static_cast<std::uintmax_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void ScratchFile::read(std::uintmax_t at, std::span<std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::pread(fd_, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0)
      throw FileError(folder_, std::string("its scratch file cannot be read: ") +
                                   (n == 0 ? "it is shorter than it should be" : std::strerror(errno)));
    at += static_cast<std::uintmax_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

}  // namespace eigenpose
