#pragma once

/// Writing a file so that a reader, a crash or a full disk never sees half of it.

#include <filesystem>
#include <string_view>

namespace eigenpose {

/// A file under construction beside its target: "TARGET.part-PID". `commit` flushes it to the disk and
/// renames it over the target; without `commit` the destructor removes it and the target stays as it was. One
/// thread at a time.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path target);
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile();

  /// Where to write. The file does not exist yet.
  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  /// fsync, rename, fsync the folder. @throws FileError, and then the target is unchanged.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path part_;
  bool committed_ = false;
};

/// The whole of `bytes` becomes the content of `target`, or nothing changes. @throws FileError.
void write_file_atomically(const std::filesystem::path& target, std::string_view bytes);

}  // namespace eigenpose
