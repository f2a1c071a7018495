#include "core/windows/foreshortened_views.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "core/base/statistics.h"

namespace eigenpose {
namespace {

std::array<std::uint8_t, 4> border_median(const cv::Mat& picture) {
  std::array<std::uint8_t, 4> level{};
  const int bands = picture.channels();
  for (int b = 0; b < bands; ++b) {
    std::vector<std::uint8_t> values;
    for (int i = 0; i < picture.cols; ++i) {
      for (const int row : {0, picture.rows - 1}) {
        values.push_back(picture.ptr<std::uint8_t>(row)[i * bands + b]);
      }
    }
    for (int i = 0; i < picture.rows; ++i) {
      for (const int column : {0, picture.cols - 1}) {
        values.push_back(picture.ptr<std::uint8_t>(i)[column * bands + b]);
      }
    }
    // An object that fills the frame touches two sides of it: the darker quarter is surely background.
    level[static_cast<std::size_t>(b)] = order_statistic(values, values.size() / 4);
  }
  return level;
}

cv::Rect object_box(const cv::Mat& picture, const std::array<std::uint8_t, 4>& level) {
  constexpr int contrast = 24;
  cv::Rect box;
  const int bands = picture.channels();
  int left = picture.cols;
  int right = -1;
  int top = picture.rows;
  int bottom = -1;
  for (int r = 0; r < picture.rows; ++r) {
    const auto* row = picture.ptr<std::uint8_t>(r);
    for (int i = 0; i < picture.cols * bands; ++i) {
      if (std::abs(static_cast<int>(row[i]) - static_cast<int>(level[static_cast<std::size_t>(i % bands)])) >
          contrast) {
        left = std::min(left, i / bands);
        right = std::max(right, i / bands);
        top = std::min(top, r);
        bottom = std::max(bottom, r);
      }
    }
  }
  return right < left ? cv::Rect(0, 0, picture.cols, picture.rows)
                      : cv::Rect(left, top, right - left + 1, bottom - top + 1);
}

}  // namespace

cv::Mat foreshortened(const cv::Mat& picture, double factor) {
  const auto level = border_median(picture);
  const cv::Rect box = object_box(picture, level);
  const double width = box.width * factor;
  const double longer = std::max(box.width, box.height);
  const double scale = longer / std::max(width, static_cast<double>(box.height));
  const double sx = scale * factor;
  const double sy = scale;
  const double cx = box.x + 0.5 * box.width - 0.5;
  const double cy = box.y + 0.5 * box.height - 0.5;
  const double middle_x = 0.5 * picture.cols - 0.5;
  const double middle_y = 0.5 * picture.rows - 0.5;
  const cv::Matx23d map(sx, 0.0, middle_x - sx * cx, 0.0, sy, middle_y - sy * cy);
  cv::Mat out;
  cv::warpAffine(picture, out, map, picture.size(), cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                 cv::Scalar(level[0], level[1], level[2]));
  return out;
}

cv::Mat mirrored(const cv::Mat& picture) {
  cv::Mat out;
  cv::flip(picture, out, 1);
  return out;
}

}  // namespace eigenpose
