#pragma once

/// Making a region comparable: cut out, scale to N×N keeping its aspect, unit energy (sections 2 and 3 of the
/// paper).

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "core/image/segmentation.h"

namespace eigenpose {

/// How a region becomes an appearance. Part of the model: learned and watched views must agree.
struct NormalizationOptions {
  int size = 64;      ///< side of the square appearance, pixels; 8…256
  bool color = true;  ///< pictures of three bands, normalised jointly; false: of one
  /// What of the picture is compared: an image type or a sum of them (image_type.h). Empty: "color" or
  /// "grey", as `color` says.
  std::string type = {};
  /// Pictures are ready-cut: each is one object, taken whole.
  bool cropped = false;
  /// How regions are found where pictures are not cropped.
  SegmentationOptions segmentation;

  friend bool operator==(const NormalizationOptions&, const NormalizationOptions&) = default;
};

/// Sets `type` and the `color` that it needs. "grey" and "color" are kept as an empty type.
/// @throws std::invalid_argument for a type that is not known.
void set_image_type(NormalizationOptions& options, const std::string& type);
/// The type's name, also where it is kept empty.
std::string image_type_name(const NormalizationOptions& options);

/// Components of one normalised picture: size × size × bands. Order: row by row, in a row pixel by pixel, in
/// a pixel blue, green, red (or grey alone).
std::size_t picture_length(const NormalizationOptions& options);
/// 3 or 1.
int picture_bands(const NormalizationOptions& options);
/// Pictures are 16-bit range: not brightness.
bool is_range(const NormalizationOptions& options);

/// Components of one appearance, which the image type makes of a picture: size × size × bands in the same
/// order.
std::size_t appearance_length(const NormalizationOptions& options);
/// Components a pixel: 3 or 1, more for sums of image types.
int appearance_bands(const NormalizationOptions& options);
/// The appearance is the picture itself: grey.
bool appearance_is_picture(const NormalizationOptions& options);

/// Scales cut-out regions. Holds scratch memory: one thread at a time; allocates nothing once it has seen the
/// largest region.
///
/// The region's box is centred in a square of its larger side, which is averaged down to N×N (each output
/// pixel is the exact mean of the area it covers; where the region is smaller than N×N, linear
/// interpolation). Beyond the box there is background, and the background's level is 0.
class Normalizer {
 public:
  /// @throws std::invalid_argument for a size outside 8…256 or an unknown image type.
  explicit Normalizer(const NormalizationOptions& options);

  [[nodiscard]] const NormalizationOptions& options() const { return options_; }
  [[nodiscard]] std::size_t length() const { return picture_length(options_); }

  /// The picture of `cut`, in grey levels above the background, not yet of unit energy.
  ///
  /// Range pictures keep the sensor's own unit: what was not measured is 0 and takes no part in the means; an
  /// output pixel of which less than half was measured is 0.
  /// @param cut CV_8UC1, CV_8UC3 or CV_16UC1; for range CV_16UC1. A grey model takes colour pictures; a
  /// colour model refuses grey ones.
  /// @param level the background's level in each band, subtracted from every pixel (not below 0).
  /// @param picture `length()` components.
  /// @return its energy ‖picture‖; 0 for a black region, which has no direction.
  /// @throws std::invalid_argument for a picture of the wrong kind.
  float normalize(const cv::Mat& cut, const std::array<std::uint8_t, 3>& level, std::span<float> picture);

 private:
  /// One axis: `extent` source pixels, centred in `square`. Every output pixel is a weighted sum of `taps`
  /// neighbouring source pixels: of as many for all, which keeps the loops over them short and even.
  struct Axis {
    int taps = 0;
    std::vector<int> first;      ///< source pixel, one an output pixel
    std::vector<float> weights;  ///< `taps` an output pixel
    int extent = -1;
    int square = -1;
  };

  void prepare(Axis& axis, int extent, int square) const;
  /// Adds row y of the cut to `sums_`, in the picture's bands and above the background; of range: depth where
  /// measured, and 1 where measured.
  void add_row(const cv::Mat& cut, int y, float weight);

  NormalizationOptions options_;
  bool range_ = false;
  Axis vertical_;
  Axis horizontal_;
  std::vector<std::uint8_t> levels_;  ///< of the background, over and over
  std::vector<float> converted_;      ///< one source row of three bands, where one is made of it
  std::vector<float> sums_;           ///< width × bands: source rows averaged vertically
  std::vector<float> depths_;         ///< of range: N × N pixels of depth and share measured
};

/// An appearance of size×size pixels averaged down to side×side; exact area means. @pre side ≤ size.
void shrink_appearance(std::span<const float> appearance, int size, int bands, int side,
                       std::span<float> reduced);

/// The picture as bytes: scaled so that its largest value is 255, then rounded. What learning keeps,
/// because inner products of bytes are exact integers. @pre equal sizes, nothing below 0.
void quantize(std::span<const float> picture, std::span<std::uint8_t> bytes);

}  // namespace eigenpose
