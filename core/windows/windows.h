#pragma once

/// Eigen-windows: parts of a region as appearances of their own, in one eigenspace for all windows of all
/// objects.
///
/// A window is 4×4 cells of the cell map. Its vector is the root of its orientation histogram and, kept
/// jointly, brightness and colour. (Ohba and Ikeuchi's eigen-windows; partial matching with appearance voting
/// of Nayar, Murase, Nene.)

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/windows/orientation_grid.h"

namespace eigenpose {

/// Sizes of the window grid.
struct WindowGrid {
  static constexpr int window = 4;                                 ///< side of a window, cells
  static constexpr int side = OrientationGrid::side - window + 1;  ///< 17 positions a side
  static constexpr int positions = side * side;                    ///< 289
  static constexpr int components = 32;                            ///< K of the window eigenspace
};

/// Length of a window's vector: 128 + 16 (grey) or 128 + 16 + 48 (colour).
[[nodiscard]] constexpr int window_length(int bands) {
  const int cells = WindowGrid::window * WindowGrid::window;
  return cells * OrientationGrid::bins + cells + (bands > 1 ? cells * bands : 0);
}

/// Writes the vector of the window whose upper left cell is (row, column), 0…16 each.
/// @return its gradient mass (sum of the orientation part), which says how much there is to see.
float window_vector(const OrientationGrid& map, int row, int column, float* out);

/// Mean and basis of all windows.
class WindowSpace {
 public:
  WindowSpace() = default;
  /// The eigenspace of the windows of `maps`: at most `limit` of them, evenly spread, taken from those whose
  /// gradient mass is above the 30 % quantile. @throws std::invalid_argument without maps.
  static WindowSpace learn(const std::vector<OrientationGrid>& maps, unsigned threads = 0,
                           std::size_t limit = 30000);
  /// Rebuilds what a model file stores. @throws std::invalid_argument for sizes that do not fit.
  static WindowSpace from_parts(Eigen::VectorXf mean, Eigen::MatrixXf basis, float mean_mass);

  [[nodiscard]] const Eigen::VectorXf& mean() const { return mean_; }
  [[nodiscard]] const Eigen::MatrixXf& basis() const { return basis_; }  ///< length × 32
  /// Mean gradient mass of a learned window.
  [[nodiscard]] float mean_mass() const { return mean_mass_; }
  [[nodiscard]] int length() const { return static_cast<int>(mean_.size()); }

  /// Projects the windows at (row, column), both running over 0, stride, 2·stride … 16.
  /// @param out one column of 32 numbers a window, row by row. @param masses gradient masses of the same, or
  /// nullptr.
  void project(const OrientationGrid& map, int stride, Eigen::MatrixXf& out,
               std::vector<float>* masses) const;

 private:
  Eigen::VectorXf mean_;
  Eigen::MatrixXf basis_;
  Eigen::VectorXf offset_;  ///< basisᵀ mean
  float mean_mass_ = 1.0F;
};

}  // namespace eigenpose
