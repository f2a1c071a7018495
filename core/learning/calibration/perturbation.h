#pragma once

/// Random misalignment, as imperfect segmentation causes it, and random tint, as light and cameras do.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include <opencv2/core.hpp>

#include "core/alignment/misalignment.h"
#include "core/base/random.h"

namespace eigenpose {

/// White balance and the light's colour are held this well.
inline constexpr double usual_tint = 0.01;

/// How far a picture is displaced at random. Each unknown is uniform between minus and plus its bound.
struct Perturbation {
  double shift = 0.0;     ///< in x and in y; share of the picture's width
  double scale = 0.0;     ///< 0.03 is ±3 %
  double turn_deg = 0.0;  ///< in the picture's plane
  double tint = 0.0;      ///< gain of red and of blue; 0.03 is ±3 %

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

/// The picture displaced and, where it has colours, tinted: the draws for one view.
cv::Mat perturbed(const cv::Mat& picture, const Perturbation& by, std::string_view object, std::size_t view);

}  // namespace eigenpose
