#pragma once

/// Where the solvers get their appearances from: memory, or files larger than memory.

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace eigenpose {

/// M views of N numbers each, read in tiles of whole views. One column is one view, scaled to unit energy.
///
/// Where the views are 8-bit, `read_bytes` gives them unscaled, so that inner products are exact integers:
/// appearance j = bytes_j / ‖bytes_j‖. A view of zero energy is the source's error (std::invalid_argument).
class AppearanceSource {
 public:
  virtual ~AppearanceSource() = default;
  [[nodiscard]] virtual std::size_t count() const = 0;   ///< M
  [[nodiscard]] virtual std::size_t length() const = 0;  ///< N
  [[nodiscard]] virtual bool has_bytes() const { return false; }
  /// Columns [first, first + tile.cols()) as unit-energy floats; tile is N × n. @throws FileError.
  virtual void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const = 0;
  /// The same as unscaled bytes, n·N of them, view after view. Only if `has_bytes()`. @throws FileError.
  virtual void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const;

 protected:
  AppearanceSource() = default;
  AppearanceSource(const AppearanceSource&) = default;
  AppearanceSource& operator=(const AppearanceSource&) = default;
};

}  // namespace eigenpose
