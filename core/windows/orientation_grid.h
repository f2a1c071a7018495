#pragma once

/// The cell map: signed gradient orientations and root brightness of a region on a 16×16 grid of cells.
///
/// A region is seen through the square root of its brightness, which makes the gradient of a surface nearly
/// independent of how strongly it is lit. Each pixel of a 64×64 picture gives the gradient of its strongest
/// band to the two neighbouring of 8 orientation bins and to the (at most) 2×2 neighbouring cells, linearly
/// in each.

#include <array>
#include <vector>

#include <opencv2/core.hpp>

namespace eigenpose {

/// The map of one region, with a frame of `pad` zero cells around it so that windows may hang over the edge.
struct OrientationGrid {
  static constexpr int pixels = 64;             ///< side of the picture the map is made of
  static constexpr int cell = 4;                ///< side of a cell, pixels
  static constexpr int cells = pixels / cell;   ///< 16 cells a side
  static constexpr int pad = 2;                 ///< zero cells around them
  static constexpr int side = cells + 2 * pad;  ///< 20
  static constexpr int bins = 8;                ///< signed orientations

  int bands = 1;                   ///< 1 (grey) or 3 (BGR)
  std::vector<float> orientation;  ///< side × side × bins, mean gradient magnitude in each bin
  std::vector<float> brightness;  ///< side × side × bands, mean root brightness above the background, 0…1

  [[nodiscard]] const float* orientation_at(int row, int column) const {
    return orientation.data() + static_cast<std::size_t>(row * side + column) * bins;
  }
  [[nodiscard]] const float* brightness_at(int row, int column) const {
    return brightness.data() +
           static_cast<std::size_t>(row * side + column) * static_cast<std::size_t>(bands);
  }
};

/// Makes cell maps. Holds scratch memory: one thread at a time.
class OrientationGridMaker {
 public:
  /// @param background root brightness (0…1) that is taken off each band.
  explicit OrientationGridMaker(std::array<float, 3> background = {0.0F, 0.0F, 0.0F})
      : background_(background) {}

  /// Fills `map` from a square CV_8UC1 or CV_8UC3 picture of any size (resized by area to 64×64).
  /// Allocates only when `map` or the picture change their kind. @throws std::invalid_argument for other
  /// pictures.
  void compute(const cv::Mat& picture, OrientationGrid& map);

 private:
  std::array<float, 3> background_;
  cv::Mat resized_;
  std::vector<float> root_;
};

/// Takes root brightness off each band, down to 0, as if `map` had been made with this background.
void take_off(const std::array<float, 3>& background, OrientationGrid& map);

/// The median over `maps` (made with no background) of the root brightness of the four corner cells, per
/// band.
std::array<float, 3> background_level(const std::vector<OrientationGrid>& maps);

}  // namespace eigenpose
