#pragma once

/// Appearances in memory, and checks that all sources share.

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "core/subspace/appearance_source.h"

namespace eigenpose {

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

/// `shape`, or one row of `length`. @throws std::invalid_argument when `length` is 0 or the shape has
/// another.
AppearanceShape checked_shape(std::optional<AppearanceShape> shape, std::size_t length);

/// @throws std::invalid_argument unless [first, first + n) lies in [0, count).
void check_columns(std::size_t first, std::size_t n, std::size_t count);

}  // namespace eigenpose
