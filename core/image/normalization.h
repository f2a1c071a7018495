#pragma once

/// Making a region comparable: cut out, scale to N×N keeping its aspect, unit energy (sections 2 and 3 of the
/// paper).

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/image/segmentation.h"

namespace eigenpose {

/// How a region becomes an appearance. Part of the model: learned and watched views must agree.
struct NormalizationOptions {
  int size = 64;      ///< side of the square appearance, pixels; 8…256
  bool color = true;  ///< three bands normalised jointly; false: grey
  /// Pictures are ready-cut: each is one object, taken whole.
  bool cropped = false;
  /// How regions are found where pictures are not cropped.
  SegmentationOptions segmentation;

  friend bool operator==(const NormalizationOptions&, const NormalizationOptions&) = default;
};

/// Numbers of one appearance: size × size × bands. Order: row by row, in a row pixel by pixel, in a pixel
/// blue, green, red (or grey alone).
std::size_t appearance_length(const NormalizationOptions& options);
/// 3 or 1.
int appearance_bands(const NormalizationOptions& options);

/// Scales cut-out regions. Holds scratch memory: one thread at a time; allocates nothing once it has seen the
/// largest region.
///
/// The region's box is centred in a square of its larger side, which is averaged down to N×N (each output
/// pixel is the exact mean of the area it covers; where the region is smaller than N×N, linear
/// interpolation). Beyond the box there is background, and the background's level is 0.
class Normalizer {
 public:
  /// @throws std::invalid_argument for a size outside 8…256.
  explicit Normalizer(const NormalizationOptions& options);

  [[nodiscard]] const NormalizationOptions& options() const { return options_; }
  [[nodiscard]] std::size_t length() const { return appearance_length(options_); }

  /// The appearance of `cut`, in grey levels above the background, not yet of unit energy.
  /// @param cut CV_8UC1, CV_8UC3 or CV_16UC1. A grey model takes colour pictures; a colour model refuses grey
  /// ones.
  /// @param level the background's level in each band, subtracted from every pixel (not below 0).
  /// @param appearance `length()` numbers.
  /// @return its energy ‖appearance‖; 0 for a black region, which has no direction.
  /// @throws std::invalid_argument for a picture of the wrong kind.
  float normalize(const cv::Mat& cut, const std::array<std::uint8_t, 3>& level, std::span<float> appearance);

 private:
  /// A weighted range of source pixels for one output pixel.
  struct Tap {
    int first = 0;
    int count = 0;
    std::size_t weight = 0;  ///< index of the first weight
  };
  /// Taps of one axis: `extent` source pixels, centred in `square`.
  struct Axis {
    std::vector<Tap> taps;
    std::vector<float> weights;
    int extent = -1;
    int square = -1;
  };

  void prepare(Axis& axis, int extent, int square) const;
  /// Row y of the cut, converted to the appearance's bands as floats above the background.
  const float* row(const cv::Mat& cut, const std::array<std::uint8_t, 3>& level, int y);

  NormalizationOptions options_;
  Axis vertical_;
  Axis horizontal_;
  std::vector<float> converted_;  ///< one source row
  std::vector<float> sums_;       ///< N rows of width × bands: the cut, averaged vertically
};

/// An appearance of size×size pixels averaged down to side×side; exact area means. @pre side ≤ size.
void shrink_appearance(std::span<const float> appearance, int size, int bands, int side,
                       std::span<float> reduced);

/// The appearance as bytes: scaled so that its largest value is 255, then rounded. What learning keeps,
/// because inner products of bytes are exact integers. @pre equal sizes.
void quantize(std::span<const float> appearance, std::span<std::uint8_t> bytes);

}  // namespace eigenpose
