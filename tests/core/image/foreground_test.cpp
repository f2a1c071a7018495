#include "core/image/foreground.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/image/occlusion.h"

namespace eigenpose {
namespace {

Background above(int threshold) {
  Background background;
  background.threshold = threshold;
  return background;
}

TEST(Foreground, IsWhatIsAboveTheThresholdInAnyBand) {
  for (int band = 0; band < 3; ++band) {
    cv::Mat cut(40, 40, CV_8UC3, cv::Scalar::all(30));
    cv::Scalar color = cv::Scalar::all(30);
    color[band] = 31;
    cv::rectangle(cut, {10, 12, 15, 9}, color, cv::FILLED);
    const cv::Mat mask = foreground_of(cut, above(30));
    EXPECT_EQ(mask.type(), CV_8UC1);
    EXPECT_EQ(cv::boundingRect(mask), cv::Rect(10, 12, 15, 9)) << band;
    EXPECT_EQ(cv::countNonZero(mask == 255), 15 * 9) << band;
  }
}

TEST(Foreground, DarkSpotsOfAnObjectAreClosedAndLargeHolesAreNot) {
  cv::Mat cut(60, 60, CV_8UC1, cv::Scalar(0));
  cv::rectangle(cut, {10, 10, 40, 40}, cv::Scalar(200), cv::FILLED);
  cv::rectangle(cut, {15, 15, 5, 5}, cv::Scalar(0), cv::FILLED);
  cv::rectangle(cut, {28, 28, 15, 15}, cv::Scalar(0), cv::FILLED);
  const cv::Mat mask = foreground_of(cut, above(100));
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(15, 15, 5, 5))), 25);
  EXPECT_EQ(mask.at<std::uint8_t>(35, 35), 0);
}

TEST(HideSquare, HidesTheShareAtTheGivenPlace) {
  for (const double share : {0.0, 0.04, 0.25, 1.0})
    for (const double place : {0.0, 0.5, 1.0}) {
      cv::Mat picture(100, 150, CV_8UC1, cv::Scalar(9));
      hide_square(picture, share, place, 1.0 - place);
      const int side = static_cast<int>(std::lround(100 * std::sqrt(share)));
      const cv::Rect square(static_cast<int>(place * (150 - side)),
                            static_cast<int>((1.0 - place) * (100 - side)), side, side);
      EXPECT_EQ(cv::countNonZero(picture == 0), side * side) << share;
      EXPECT_EQ(cv::countNonZero(picture(square)), 0) << share << " " << place;
    }
}

}  // namespace
}  // namespace eigenpose
