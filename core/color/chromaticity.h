#pragma once

/// Chromaticities of a picture, and how often each occurs.
///
/// The chromaticity of a pixel with brightness l = (R + G + B)/3 is a point (u, v) of the unit square: of its
/// opponent differences d = R − G and d = (R + G)/2 − B,
///
///     ½ + ½ · d / (|d| + 0.3·(l + 8))
///
/// which does not change with the gain of a bright pixel, and tends to grey (½, ½) for a dark one.
/// Frequencies are those of 8×8 bins, each pixel shared among the four nearest and counted by its brightness.
/// They are kept as roots, a unit vector r: the Hellinger distance of two is ‖r₁ − r₂‖/√2 (Bhattacharyya
/// 1943).

#include <array>
#include <cstdint>
#include <span>

#include <opencv2/core.hpp>

namespace eigenpose {

/// The chromaticities of a picture, in 16×16 pixels, row by row, 0…255.
struct ChromaticityMap {
  static constexpr int side = 16;
  static constexpr std::size_t pixels = std::size_t{side} * side;
  static constexpr std::size_t bytes = 3 * pixels;

  std::array<std::uint8_t, pixels> u{};  ///< red against green
  std::array<std::uint8_t, pixels> v{};  ///< yellow against blue
  std::array<std::uint8_t, pixels> brightness{};

  friend bool operator==(const ChromaticityMap&, const ChromaticityMap&) = default;
};

/// @param picture 8-bit BGR, square, of any size: it is brought to 64×64 pixels first, so that a view and a
/// region of it have the same map whatever size they come in.
/// @param background root brightness (0…1) of each band that is taken off, as the windows do.
ChromaticityMap chromaticity_map(const cv::Mat& picture, const std::array<float, 3>& background = {});

/// Roots of the frequencies: a unit vector, or zeros where nothing is bright.
using ChromaticityRoots = std::array<float, 64>;

/// @param visible weight of each pixel, 0…1; empty: all are visible.
ChromaticityRoots chromaticity_roots(const ChromaticityMap& map, std::span<const float> visible = {});

/// Hellinger distance, 0…1; 1 where nothing is bright in either.
double hellinger_distance(const ChromaticityRoots& a, const ChromaticityRoots& b);

}  // namespace eigenpose
