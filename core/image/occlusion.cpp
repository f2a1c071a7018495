#include "core/image/occlusion.h"

#include <algorithm>
#include <cmath>

namespace eigenpose {

void hide_square(cv::Mat& picture, double share, double across, double down) {
  const int side = static_cast<int>(std::lround(std::sqrt(share) * std::min(picture.cols, picture.rows)));
  const cv::Rect square(static_cast<int>(across * (picture.cols - side)),
                        static_cast<int>(down * (picture.rows - side)), side, side);
  picture(square & cv::Rect(0, 0, picture.cols, picture.rows)).setTo(cv::Scalar::all(0));
}

}  // namespace eigenpose
