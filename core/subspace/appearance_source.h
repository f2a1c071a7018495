#pragma once

/// Where the solvers get their appearances from: memory, or files larger than memory.

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace eigenpose {

/// How the N numbers of an appearance lie: rows × columns × bands, bands of a pixel together.
struct AppearanceShape {
  std::size_t rows = 1;
  std::size_t columns = 0;
  std::size_t bands = 1;

  [[nodiscard]] std::size_t length() const { return rows * columns * bands; }
  friend bool operator==(const AppearanceShape&, const AppearanceShape&) = default;
};

/// M views of N numbers each, read in tiles of whole views. One column is one view, scaled to unit energy.
///
/// Where the views are 8-bit, `read_bytes` gives them unscaled, so that inner products are exact integers:
/// appearance j = bytes_j / ‖bytes_j‖. A view of zero energy is the source's error (std::invalid_argument).
///
/// The solvers call it from one thread at a time, the one that called them.
class AppearanceSource {
 public:
  virtual ~AppearanceSource() = default;
  [[nodiscard]] virtual std::size_t count() const = 0;   ///< M
  [[nodiscard]] virtual std::size_t length() const = 0;  ///< N
  /// How the N numbers form a picture: only the spatial-temporal solver asks. Default: one row of N.
  [[nodiscard]] virtual AppearanceShape shape() const { return {1, length(), 1}; }
  /// Sizes of the groups of neighbouring views that look alike, such as those of one object; they add up to
  /// M. Only the joined solver asks. Default: one group.
  [[nodiscard]] virtual std::vector<std::size_t> groups() const { return {count()}; }
  [[nodiscard]] virtual bool has_bytes() const { return false; }
  /// Columns [first, first + tile.cols()) as unit-energy floats; tile is N × n. @throws FileError.
  virtual void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const = 0;
  /// The same as unscaled bytes, n·N of them, view after view. Only if `has_bytes()`. @throws FileError.
  virtual void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const;
  /// All M·N bytes where they stand in memory already, so that nobody copies them; otherwise null.
  [[nodiscard]] virtual const std::uint8_t* resident_bytes() const { return nullptr; }
  /// All M·N unit-energy floats where they stand in memory already; otherwise null.
  [[nodiscard]] virtual const float* resident_floats() const { return nullptr; }

 protected:
  AppearanceSource() = default;
  AppearanceSource(const AppearanceSource&) = default;
  AppearanceSource& operator=(const AppearanceSource&) = default;
};

}  // namespace eigenpose
