#pragma once

/// Appearances of 8-bit pixels in memory, for tests and benchmarks of the solvers.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// M views of 8-bit pixels, view after view. Borrows the bytes: they must outlive the source.
class ByteSource final : public AppearanceSource {
 public:
  /// @throws std::invalid_argument when `length` is 0, the bytes are not a whole number of views, or `shape`,
  /// if given, has another length.
  ByteSource(std::span<const std::uint8_t> bytes, std::size_t length,
             std::optional<AppearanceShape> shape = std::nullopt);

  [[nodiscard]] std::size_t count() const override { return count_; }
  [[nodiscard]] std::size_t length() const override { return shape_.length(); }
  [[nodiscard]] AppearanceShape shape() const override { return shape_; }
  [[nodiscard]] bool has_bytes() const override { return true; }
  /// @throws std::invalid_argument for a black view or columns outside [0, M).
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override;
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override;
  [[nodiscard]] const std::uint8_t* resident_bytes() const override { return bytes_.data(); }

 private:
  std::span<const std::uint8_t> bytes_;
  AppearanceShape shape_;
  std::size_t count_ = 0;
};

/// `n` views of `length` bytes, each divided by its norm, into the columns of `tile`.
/// @param first number of the first view, for the error text. @throws std::invalid_argument for a black view.
void bytes_to_unit_columns(const std::uint8_t* bytes, std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile);

}  // namespace eigenpose
