#include "core/base/file_lock.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {

FileLock::FileLock(const std::filesystem::path& file, const std::string& owned) : file_(file) {
  const auto refuse = [&](const std::string& what) {
    if (fd_ >= 0) ::close(fd_);
    throw FileError(file, what);
  };
  for (;;) {
    fd_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0644);
    if (fd_ < 0) refuse(std::string("cannot be opened to lock ") + owned + ": " + std::strerror(errno));
    struct stat locked {};
    if (::fstat(fd_, &locked) != 0 || !S_ISREG(locked.st_mode))
      refuse("is not a plain file and cannot lock " + owned + "; remove it");
    int result = 0;
    do result = ::flock(fd_, LOCK_EX | LOCK_NB);
    while (result != 0 && errno == EINTR);
    if (result != 0 && errno == EWOULDBLOCK)
      refuse("is locked: another program uses " + owned + "; wait until it has ended");
    if (result != 0) refuse(std::string("cannot be locked: ") + std::strerror(errno));
    // The former owner may have removed the file after it was opened here: then another one is to be locked.
    struct stat named {};
    if (::stat(file.c_str(), &named) == 0 && named.st_ino == locked.st_ino && named.st_dev == locked.st_dev)
      return;
    ::close(fd_);
    fd_ = -1;
  }
}

FileLock::~FileLock() {
  (void)::unlink(file_.c_str());  // before the lock ends: whoever has opened it sees that it is removed
  ::close(fd_);
}

}  // namespace eigenpose
