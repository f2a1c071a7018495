#include "core/base/input_file.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

void check_plain(const std::filesystem::path& file, const struct stat& status) {
  if (!S_ISREG(status.st_mode))
    throw FileError(file, std::string("is ") + kind_of(status.st_mode) + "; give a plain file");
}

}  // namespace

InputFile::InputFile(std::filesystem::path file) : file_(std::move(file)) {
  const auto refuse = [&] {
    throw FileError(file_, errno == ENOENT ? std::string("is not there; check its name")
                                           : std::string("cannot be opened: ") + std::strerror(errno));
  };
  struct stat status {};
  if (::stat(file_.c_str(), &status) != 0) refuse();
  check_plain(file_, status);
  // It may have been replaced since: O_NONBLOCK does not wait for a pipe's writer.
  fd_ = ::open(file_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (fd_ < 0) refuse();
  try {
    if (::fstat(fd_, &status) != 0) refuse();
    check_plain(file_, status);
  } catch (...) {
    ::close(fd_);
    throw;
  }
  size_ = static_cast<std::uintmax_t>(status.st_size);
}

InputFile::~InputFile() {
  ::close(fd_);
}

std::size_t InputFile::read_some(std::uintmax_t at, std::span<std::uint8_t> bytes) const {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::pread(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(at + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw FileError(file_, std::string("cannot be read: ") + std::strerror(errno));
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

std::vector<unsigned char> read_file(const std::filesystem::path& file) {
  const InputFile in(file);
  if (in.size() > most_bytes_in_memory)
    throw FileError(file, "has " + std::to_string(in.size() >> 20) + " MiB; at most " +
                              std::to_string(most_bytes_in_memory >> 20) + " MiB are read");
  std::vector<unsigned char> bytes(in.size());
  if (in.read_some(0, bytes) != bytes.size())
    throw FileError(file, "became shorter while it was read; read it again when nobody writes it");
  return bytes;
}

}  // namespace eigenpose
