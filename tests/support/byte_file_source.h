#pragma once

/// Appearances that lie in a file, for sets larger than memory.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// M views of 8-bit numbers in a plain file, view after view, nothing else in it. Reads on demand, holds no
/// views.
class ByteFileSource final : public AppearanceSource {
 public:
  /// @throws FileError when the file cannot be opened, or is not a whole number of views of `length` bytes;
  /// std::invalid_argument when `length` is 0 or `shape`, if given, has another length.
  ByteFileSource(std::filesystem::path file, std::size_t length,
                 std::optional<AppearanceShape> shape = std::nullopt);
  ByteFileSource(const ByteFileSource&) = delete;
  ByteFileSource& operator=(const ByteFileSource&) = delete;
  ~ByteFileSource() override;

  [[nodiscard]] std::size_t count() const override { return count_; }
  [[nodiscard]] std::size_t length() const override { return shape_.length(); }
  [[nodiscard]] AppearanceShape shape() const override { return shape_; }
  [[nodiscard]] bool has_bytes() const override { return true; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override;
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override;

 private:
  std::filesystem::path file_;
  AppearanceShape shape_;
  std::size_t count_ = 0;
  int descriptor_ = -1;
};

}  // namespace eigenpose
