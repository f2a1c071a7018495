#pragma once

/// One owner for each state folder.

#include <filesystem>

namespace eigenpose {

/// Holds the state folder for this process; another process, or another object in this one, is refused. The
/// system gives the folder back when the process ends, however it ends.
class StateLock {
 public:
  /// @throws FileError naming the process that holds the folder, or what the system refuses.
  explicit StateLock(const std::filesystem::path& folder);
  StateLock(const StateLock&) = delete;
  StateLock& operator=(const StateLock&) = delete;
  ~StateLock();

 private:
  int descriptor_ = -1;
};

}  // namespace eigenpose
