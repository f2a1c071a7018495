#include "core/windows/foreshortened_views.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

constexpr int picture_side = 64;

/// A bright box on a darker background.
cv::Mat box_at(const cv::Rect& box) {
  cv::Mat picture(picture_side, picture_side, CV_8UC3, cv::Scalar(30, 20, 10));
  picture(box).setTo(cv::Scalar(200, 220, 240));
  return picture;
}

/// Where the picture is brighter than half way to the box.
cv::Rect bright(const cv::Mat& picture) {
  cv::Mat grey;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  return cv::boundingRect(grey > 120);
}

TEST(Foreshortened, LeavesACentredObjectAsItIsWhereNothingIsForeshortened) {
  for (const cv::Rect& box : {cv::Rect(22, 17, 20, 30), cv::Rect(12, 22, 40, 20)}) {
    const cv::Mat picture = box_at(box);
    EXPECT_EQ(cv::norm(foreshortened(picture, 1.0), picture, cv::NORM_INF), 0.0);
  }
}

TEST(Foreshortened, PutsAnObjectIntoTheMiddleAndGivesItsLongerSideTheLengthItHad) {
  // 40×20 of factor ½ is a square of the longer side, of factor 2 it is 40×10, of factor ¼ 20×40.
  const cv::Mat picture = box_at({3, 40, 40, 20});
  EXPECT_EQ(bright(foreshortened(picture, 0.5)), cv::Rect(12, 12, 40, 40));
  EXPECT_EQ(bright(foreshortened(picture, 2.0)), cv::Rect(12, 27, 40, 10));
  EXPECT_EQ(bright(foreshortened(picture, 0.25)), cv::Rect(22, 12, 20, 40));
}

TEST(Foreshortened, UncoversTheBackgroundOfEveryBand) {
  const cv::Mat result = foreshortened(box_at({0, 0, 40, 30}), 0.5);
  for (const cv::Point& corner : {cv::Point(0, 0), cv::Point(63, 0), cv::Point(0, 63), cv::Point(63, 63)})
    EXPECT_EQ(result.at<cv::Vec3b>(corner), cv::Vec3b(30, 20, 10)) << corner;
}

TEST(Mirrored, ExchangesLeftAndRight) {
  EXPECT_EQ(bright(mirrored(box_at({3, 40, 10, 20}))), cv::Rect(51, 40, 10, 20));
}

}  // namespace
}  // namespace eigenpose
