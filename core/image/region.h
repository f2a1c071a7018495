#pragma once

/// A connected part of the picture that stands out from the background and may be an object.

#include <opencv2/core.hpp>

namespace eigenpose {

/// One region of a frame, in pixel coordinates of that frame.
struct Region {
  cv::Rect box;                 ///< tight bounding box
  int area = 0;                 ///< foreground pixels in it
  bool touches_border = false;  ///< part of it may be outside the picture
};

/// Intersection over union of two boxes, 0…1.
inline double shared_area(const cv::Rect& a, const cv::Rect& b) {
  const double both = (a & b).area();
  return both / (a.area() + b.area() - both);
}

}  // namespace eigenpose
