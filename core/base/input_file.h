#pragma once

/// Reading files. Every reader of a file that a person or another program put there opens it here.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace eigenpose {

/// An open plain file. A pipe, a socket, a device or a folder is refused without being opened, so that
/// nothing waits for a writer that never comes and no device is touched. Const calls are thread-safe.
class InputFile {
 public:
  /// @throws FileError: missing, not allowed, not a plain file.
  explicit InputFile(std::filesystem::path file);
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile();

  [[nodiscard]] const std::filesystem::path& path() const { return file_; }
  /// Bytes when it was opened.
  [[nodiscard]] std::uintmax_t size() const { return size_; }
  /// Reads up to `bytes.size()` bytes from position `at`. @return how many; fewer only at the end of the
  /// file.
  /// @throws FileError.
  std::size_t read_some(std::uintmax_t at, std::span<std::uint8_t> bytes) const;

 private:
  std::filesystem::path file_;
  int fd_ = -1;
  std::uintmax_t size_ = 0;
};

/// Files larger than this are not read as a whole: no picture, configuration or journal is that large.
inline constexpr std::uintmax_t most_bytes_in_memory = std::uintmax_t{1} << 30;

/// The bytes of a whole file. @throws FileError as InputFile does; too large; shortened while it was read.
std::vector<unsigned char> read_file(const std::filesystem::path& file);

}  // namespace eigenpose
