#include "tests/support/byte_file_source.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/subspace/memory_source.h"
#include "tests/support/byte_source.h"

namespace eigenpose {

ByteFileSource::ByteFileSource(std::filesystem::path file, std::size_t length,
                               std::optional<AppearanceShape> shape)
    : file_(std::move(file)), shape_(checked_shape(shape, length)) {
  descriptor_ = ::open(file_.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat facts = {};
  if (descriptor_ < 0 || ::fstat(descriptor_, &facts) != 0) {
    const std::string cause = std::strerror(errno);
    if (descriptor_ >= 0) ::close(descriptor_);
    throw FileError(file_, "cannot be opened: " + cause + ": give a readable file of views");
  }
  const auto bytes = static_cast<std::size_t>(facts.st_size);
  if (bytes % length != 0) {
    ::close(descriptor_);
    throw FileError(file_, "has " + std::to_string(bytes) + " bytes, not a whole number of views of " +
                               std::to_string(length) + ": write it again");
  }
  count_ = bytes / length;
}

ByteFileSource::~ByteFileSource() {
  ::close(descriptor_);
}

void ByteFileSource::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(tile.size()));
  read_bytes(first, static_cast<std::size_t>(tile.cols()), bytes.data());
  bytes_to_unit_columns(bytes.data(), first, tile);
}

void ByteFileSource::read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const {
  check_columns(first, n, count_);
  std::size_t done = 0;
  const std::size_t wanted = n * length();
  while (done < wanted) {
    const ssize_t got =
        ::pread(descriptor_, tile + done, wanted - done, static_cast<off_t>(first * length() + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw FileError(file_, std::string("cannot be read to its end: ") +
                                 (got < 0 ? std::strerror(errno) : "it became shorter") + ": write it again");
    }
    done += static_cast<std::size_t>(got);
  }
}

}  // namespace eigenpose
