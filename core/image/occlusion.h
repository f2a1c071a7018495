#pragma once

/// Hides a part of a picture: what evaluation shows and calibration learns from.

#include <opencv2/core.hpp>

namespace eigenpose {

/// Covers `share` (0…1) of the smaller side squared of `picture` with a black square.
/// @param across,down position of the square within the free room, 0…1.
void hide_square(cv::Mat& picture, double share, double across, double down);

}  // namespace eigenpose
