#pragma once

/// One owner at a time for what stands in files: a state folder, an image set.

#include <filesystem>
#include <string>

namespace eigenpose {

/// Exclusive ownership, shown by a lock (flock) on a file that is made where it is missing and stays. The
/// lock ends with the object, and with the process however it ends. A second lock in the same process is
/// refused as well.
class FileLock {
 public:
  /// @param owned what is owned, for the message: "the image set".
  /// @throws FileError when another owner has it, or the file cannot be made; never waits.
  FileLock(const std::filesystem::path& file, const std::string& owned);
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock();

 private:
  std::filesystem::path file_;
  int fd_ = -1;
};

}  // namespace eigenpose
