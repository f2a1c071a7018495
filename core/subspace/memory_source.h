#pragma once

/// Appearances that stand in memory.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// M views of 8-bit numbers, view after view. Borrows the bytes: they must outlive the source.
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

/// M views of floats, the columns of a matrix, used as they are. Owns the matrix.
class FloatSource final : public AppearanceSource {
 public:
  /// @throws std::invalid_argument for an empty matrix or a `shape` of another length.
  explicit FloatSource(Eigen::MatrixXf columns, std::optional<AppearanceShape> shape = std::nullopt);

  [[nodiscard]] std::size_t count() const override { return static_cast<std::size_t>(columns_.cols()); }
  [[nodiscard]] std::size_t length() const override { return shape_.length(); }
  [[nodiscard]] AppearanceShape shape() const override { return shape_; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override;
  [[nodiscard]] const float* resident_floats() const override { return columns_.data(); }

 private:
  Eigen::MatrixXf columns_;
  AppearanceShape shape_;
};

/// `n` views of `length` bytes, each divided by its norm, into the columns of `tile`.
/// @param first number of the first view, for the error text. @throws std::invalid_argument for a black view.
void bytes_to_unit_columns(const std::uint8_t* bytes, std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile);

/// `shape`, or one row of `length`. @throws std::invalid_argument when `length` is 0 or the shape has
/// another.
AppearanceShape checked_shape(std::optional<AppearanceShape> shape, std::size_t length);

/// @throws std::invalid_argument unless [first, first + n) lies in [0, count).
void check_columns(std::size_t first, std::size_t n, std::size_t count);

}  // namespace eigenpose
