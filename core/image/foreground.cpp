#include "core/image/foreground.h"

#include <vector>

#include <opencv2/imgproc.hpp>

namespace eigenpose {

cv::Mat foreground_of(const cv::Mat& cut, const Background& background) {
  cv::Mat brightest;
  if (cut.channels() == 3) {
    std::vector<cv::Mat> bands;
    cv::split(cut, bands);
    brightest = cv::max(cv::max(bands[0], bands[1]), bands[2]);
  } else {
    brightest = cut;
  }
  cv::Mat mask = brightest > background.threshold;
  // Dark spots of an object are part of it.
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, cv::Mat::ones(7, 7, CV_8U));
  return mask;
}

}  // namespace eigenpose
