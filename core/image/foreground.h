#pragma once

/// The pixels of a cut-out that belong to what was cut out.

#include <opencv2/core.hpp>

#include "core/image/segmentation.h"

namespace eigenpose {

/// 255 where the brightest band is above the background's threshold, dark spots within closed; else 0.
/// @param cut as Segmenter::cut_out gives it, 8 bits.
cv::Mat foreground_of(const cv::Mat& cut, const Background& background);

}  // namespace eigenpose
