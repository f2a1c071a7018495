#pragma once

/// Random misalignment, as imperfect segmentation causes it.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include <opencv2/core.hpp>

#include "core/alignment/misalignment.h"
#include "core/base/random.h"

namespace eigenpose {

/// How far a picture is displaced at random. Each unknown is uniform between minus and plus its bound.
struct Perturbation {
  double shift = 0.0;     ///< in x and in y; share of the picture's width
  double scale = 0.0;     ///< 0.03 is ±3 %
  double turn_deg = 0.0;  ///< in the picture's plane

  /// One draw: four numbers of the sequence. Its gain is 0.
  [[nodiscard]] Misalignment draw(SeededRandom& random) const;
  /// The draw for one view: the same wherever it is shown, whatever other objects there are.
  [[nodiscard]] Misalignment of(std::string_view object, std::size_t view) const;
};

/// The seed of what is drawn for a view. Depends on no other object.
std::uint32_t seed_of(std::string_view object, std::size_t view);

/// `picture` with a misalignment applied, about its middle; beyond its edge it goes on as it ends. Bilinear;
/// 16-bit pictures (ranges) take the nearest pixel, as a mean of distances with "not measured" is neither.
cv::Mat displaced(const cv::Mat& picture, const Misalignment& by);

}  // namespace eigenpose
