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

}  // namespace eigenpose
