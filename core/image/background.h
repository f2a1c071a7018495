#pragma once

/// Measuring the background of one picture.

#include <opencv2/core.hpp>

#include "core/image/segmentation.h"

namespace eigenpose {

/// The darkest strong peak of the picture's histogram and its width. Looks at some ten thousand pixels,
/// evenly spread.
/// @pre CV_8UC1 or CV_8UC3, not empty.
Background measure_background(const cv::Mat& image, const SegmentationOptions& options);

}  // namespace eigenpose
