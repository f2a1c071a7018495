#include "daemon/api/unix_socket.h"

#include <cerrno>
#include <cstring>
#include <vector>

#include <grp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"
#include "daemon/api/client/local_address.h"

namespace eigenpose {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
  throw FileError(path, what + ": " + std::strerror(errno));
}

gid_t group_id(const std::filesystem::path& path, const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> buffer(16384);
  if (::getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) != 0 || found == nullptr)
    throw FileError(path, "there is no group \"" + name + "\": create it or change the group in [api]");
  return entry.gr_gid;
}

}  // namespace

UnixSocket::UnixSocket(std::filesystem::path path, unsigned mode, const std::string& group)
    : path_(std::move(path)) {
  try {
    claim(mode, group);
  } catch (...) {
    release();
    throw;
  }
}

UnixSocket::~UnixSocket() {
  release();
}

void UnixSocket::claim(unsigned mode, const std::string& group) {
  const sockaddr_un address = local_address(path_);
  struct stat status {};
  if (::lstat(path_.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) throw FileError(path_, "is there and is not a socket: move it away");
    if (is_answered(path_))
      throw FileError(
          path_,
          "another eigenposed answers on this socket: stop it first, or give this one another runtime_dir");
    if (::unlink(path_.c_str()) != 0) fail(path_, "a stale socket cannot be removed");
  }
  fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd_ < 0) fail(path_, "no socket can be made");
  // Nobody but the owner gets in before mode and group are right.
  if (::fchmod(fd_, 0600) != 0) fail(path_, "its mode cannot be set");
  if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
    fail(path_, "the socket cannot be made there");
  if (::lstat(path_.c_str(), &status) != 0) fail(path_, "the socket vanished");
  device_ = status.st_dev;
  inode_ = status.st_ino;
  if (!group.empty() && ::chown(path_.c_str(), static_cast<uid_t>(-1), group_id(path_, group)) != 0)
    fail(path_, "cannot be given to group \"" + group + "\"");
  if (::chmod(path_.c_str(), mode) != 0) fail(path_, "its mode cannot be set");
  if (::listen(fd_, SOMAXCONN) != 0) fail(path_, "cannot be listened on");
}

void UnixSocket::release() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  struct stat status {};
  if (inode_ != 0 && ::lstat(path_.c_str(), &status) == 0 && status.st_dev == device_ &&
      status.st_ino == inode_)
    ::unlink(path_.c_str());
  inode_ = 0;
}

}  // namespace eigenpose
