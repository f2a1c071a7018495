#pragma once

/// A listening Unix socket in the file system, claimed and given back tidily.

#include <filesystem>
#include <string>

#include <sys/types.h>

namespace eigenpose {

/// Owns a listening socket and its file. The destructor closes it and removes the file. One thread at a time.
class UnixSocket {
 public:
  /// Binds and listens. A socket file that nobody answers on is replaced.
  /// @param mode file mode, @param group owning group; empty: unchanged.
  /// @throws FileError when a live program answers there, when the path is something else than a socket or
  /// longer than a Unix socket allows (107 bytes), when the group is unknown, or when the system refuses.
  UnixSocket(std::filesystem::path path, unsigned mode, const std::string& group);
  UnixSocket(const UnixSocket&) = delete;
  UnixSocket& operator=(const UnixSocket&) = delete;
  ~UnixSocket();

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// The descriptor, still owned by this object.
  [[nodiscard]] int descriptor() const { return fd_; }

 private:
  void claim(unsigned mode, const std::string& group);
  void release() noexcept;

  std::filesystem::path path_;
  int fd_ = -1;
  dev_t device_ = 0;  ///< of our file, so that a successor's is never removed
  ino_t inode_ = 0;
};

}  // namespace eigenpose
