#pragma once

/// A file that grows line by line and keeps every line that it has taken.

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "core/base/atomic_file.h"

namespace eigenpose {

/// A journal that is open for writing. A line is there whole or not at all for whoever stops reading at the
/// last line end. One writer at a time: whoever makes one owns the file (file_lock.h). One thread at a time.
class JournalFile {
 public:
  /// Makes the file where it is missing, and cuts off what follows its first `good_bytes` bytes: what a crash
  /// left of a line. @param calls outlives this object. @throws FileError, also for what is no plain file.
  JournalFile(std::filesystem::path file, std::uint64_t good_bytes, FileCalls& calls = FileCalls::system());
  JournalFile(const JournalFile&) = delete;
  JournalFile& operator=(const JournalFile&) = delete;
  ~JournalFile();

  [[nodiscard]] std::uint64_t size() const { return good_bytes_; }
  /// Writes at the end. @throws FileError (disk full, …), and then the journal is as it was before.
  void append(std::string_view lines);
  /// Flushes what was appended to the disk. @throws FileError.
  void flush();
  /// Drops what stands after the first `size` bytes: what was appended last. @throws FileError.
  void cut_to(std::uint64_t size);

 private:
  FileCalls& calls_;
  std::filesystem::path file_;
  std::uint64_t good_bytes_;
  bool to_be_cut_ = false;  ///< something after the good bytes could not be cut off yet
  int fd_ = -1;
};

}  // namespace eigenpose
