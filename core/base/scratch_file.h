#pragma once

/// Room on disk for what does not fit into memory; gone when the object is, and also after a crash.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

namespace eigenpose {

/// A file without a name. Calls are thread-safe where they concern different bytes.
class ScratchFile {
 public:
  /// @param folder where the disk has room; empty: the system's folder for temporary files.
  /// @throws FileError when the folder takes no file or has not `size` bytes free.
  ScratchFile(const std::filesystem::path& folder, std::uintmax_t size);
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  ~ScratchFile();

  /// @throws FileError (disk full, …).
  void write(std::uintmax_t at, std::span<const std::uint8_t> bytes);
  /// @throws FileError, also for bytes that were never written.
  void read(std::uintmax_t at, std::span<std::uint8_t> bytes) const;

 private:
  std::filesystem::path folder_;
  int fd_ = -1;
};

}  // namespace eigenpose
