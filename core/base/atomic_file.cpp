#include "core/base/atomic_file.h"

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// One open descriptor.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_;
};

void sync_path(const std::filesystem::path& path, int flags) {
  const Descriptor fd(::open(path.c_str(), flags | O_CLOEXEC));
  if (fd.get() < 0) throw FileError(path, std::string("cannot open to flush it: ") + std::strerror(errno));
  // Some file systems do not flush folders; that is no reason to lose the work.
  if (::fsync(fd.get()) != 0 && errno != EINVAL && errno != EROFS)
    throw FileError(path, std::string("cannot be flushed to the disk: ") + std::strerror(errno));
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  static std::atomic<unsigned> serial{0};
  part_ = target_;
  part_ += ".part-" + std::to_string(::getpid()) + "-" + std::to_string(serial++);
}

AtomicFile::~AtomicFile() {
  if (committed_) return;
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void AtomicFile::commit() {
  sync_path(part_, O_RDONLY);
  std::error_code error;
  std::filesystem::rename(part_, target_, error);
  if (error) throw FileError(target_, "cannot be replaced: " + error.message());
  committed_ = true;
  const auto folder = target_.parent_path();
  sync_path(folder.empty() ? std::filesystem::path(".") : folder, O_RDONLY | O_DIRECTORY);
}

void write_file_atomically(const std::filesystem::path& target, std::string_view bytes) {
  AtomicFile file(target);
  {
    const Descriptor fd(::open(file.part().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
    if (fd.get() < 0) throw FileError(target, std::string("cannot be written: ") + std::strerror(errno));
    while (!bytes.empty()) {
      const ssize_t written = ::write(fd.get(), bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0)
        throw FileError(target, std::string("cannot be written: ") + std::strerror(errno) +
                                    "; the former file is unchanged");
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }
  file.commit();
}

}  // namespace eigenpose
