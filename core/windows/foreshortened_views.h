#pragma once

/// Views that were never taken: foreshortened and mirrored copies of learned ones, for when there are few.

#include <opencv2/core.hpp>

namespace eigenpose {

/// The picture as if its object had turned a little: stretched horizontally by `factor` about its middle, and
/// scaled so that the longer side of the object stays what it was. The object is what differs from the
/// picture's background (the median of its border) by more than 24 grey levels in any band.
cv::Mat foreshortened(const cv::Mat& picture, double factor);

/// The mirror image, left to right.
cv::Mat mirrored(const cv::Mat& picture);

}  // namespace eigenpose
