#pragma once

/// Finding what stands out from a dark, plain background (section 2 of the paper).
///
/// The background's level and noise are measured in every picture: the darkest strong peak of the histogram.
/// A pixel is foreground when its brightest band is above level + max(least contrast, several sigmas).
/// Foreground pixels closer than a small gap belong together, so that a dark stripe does not cut an object in
/// two.

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include <opencv2/core.hpp>

#include "core/image/region.h"

namespace eigenpose {

struct SegmentationOptions {
  int least_contrast =
      12;  ///< grey levels above the background; 1…200. Above camera noise and faint reflections.
  double noise_sigmas = 5;  ///< false pixels by noise alone: one in a million
  /// Pixels without foreground that do not part a region; 0…16.
  int bridged_gap = 3;
  /// A region with a smaller share of the picture is dirt and not reported.
  double dirt_share = 0.0003;

  friend bool operator==(const SegmentationOptions&, const SegmentationOptions&) = default;
};

/// What was measured of the background, in grey levels of 0…255.
struct Background {
  std::array<std::uint8_t, 3> level{};  ///< per band; a grey picture has one
  double noise = 0.0;                   ///< 1 sigma of the brightest band
  int threshold = 0;                    ///< a pixel is foreground when its brightest band is above

  /// `level` as OpenCV takes colours.
  [[nodiscard]] cv::Scalar color() const {
    return {static_cast<double>(level[0]), static_cast<double>(level[1]), static_cast<double>(level[2])};
  }
};

/// Finds regions. Holds scratch memory, and allocates nothing once it has seen a picture of the same size and
/// as many regions. One thread at a time.
class Segmenter {
 public:
  explicit Segmenter(SegmentationOptions options = {});
  ~Segmenter();
  Segmenter(Segmenter&&) noexcept;
  Segmenter& operator=(Segmenter&&) noexcept;

  /// The regions of `image` (CV_8UC1, CV_8UC3 or CV_16UC1), left to right. Valid until the next call.
  /// @throws std::invalid_argument for another type or an empty picture.
  std::span<const Region> segment(const cv::Mat& image);

  /// What `segment` measured last.
  [[nodiscard]] const Background& background() const;

  /// The pixels of region `index` of the last `segment(image)`: its box, in which other regions are painted
  /// with the background. Shares memory with `image` when no other region reaches into the box; valid until
  /// the next call.
  const cv::Mat& cut_out(const cv::Mat& image, std::size_t index);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
