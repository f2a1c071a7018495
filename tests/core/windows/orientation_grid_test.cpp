#include "core/windows/orientation_grid.h"

#include <numeric>

#include <gtest/gtest.h>

#include "core/windows/foreshortened_views.h"
#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

OrientationGrid map_of(const cv::Mat& picture) {
  OrientationGridMaker mapper;
  OrientationGrid map;
  mapper.compute(picture, map);
  return map;
}

TEST(OrientationGrid, OfAMirroredPictureIsTheMirroredMap) {
  const cv::Mat picture = test::DrawnObject(1).view(40.0);
  const OrientationGrid map = map_of(picture);
  const OrientationGrid other = map_of(mirrored(picture));
  // Rounding only: the same sums in another order.
  constexpr float tolerance = 2e-4F;
  for (int r = 0; r < OrientationGrid::side; ++r) {
    for (int c = 0; c < OrientationGrid::side; ++c) {
      const int m = OrientationGrid::side - 1 - c;
      EXPECT_NEAR(map.brightness_at(r, c)[0], other.brightness_at(r, m)[0], tolerance);
      for (int b = 0; b < OrientationGrid::bins; ++b) {
        // Left and right change places: angle a becomes 180° − a.
        const int turned = (OrientationGrid::bins / 2 - b + OrientationGrid::bins) % OrientationGrid::bins;
        EXPECT_NEAR(map.orientation_at(r, c)[b], other.orientation_at(r, m)[turned], tolerance);
      }
    }
  }
}

TEST(OrientationGrid, PutsAnEdgeIntoTheBinOfItsDirection) {
  cv::Mat picture(64, 64, CV_8UC1, cv::Scalar(0));
  picture.colRange(32, 64).setTo(255);  // brighter to the right: gradient along +x, bin 0
  const OrientationGrid map = map_of(picture);
  double right = 0.0;
  double all = 0.0;
  for (int i = 0; i < OrientationGrid::side * OrientationGrid::side; ++i) {
    right += map.orientation[static_cast<std::size_t>(i) * OrientationGrid::bins];
    all += std::accumulate(map.orientation.begin() + i * OrientationGrid::bins,
                           map.orientation.begin() + (i + 1) * OrientationGrid::bins, 0.0);
  }
  EXPECT_GT(all, 0.0);
  EXPECT_NEAR(right, all, 1e-6 * all);
}

TEST(OrientationGrid, IsZeroInItsFrame) {
  const OrientationGrid map = map_of(cv::Mat(64, 64, CV_8UC1, cv::Scalar(200)));
  EXPECT_EQ(map.brightness_at(1, 7)[0], 0.0F);
  EXPECT_GT(map.brightness_at(2, 7)[0], 0.0F);
  EXPECT_NEAR(map.brightness_at(10, 10)[0], std::sqrt(200.0F / 255.0F), 1e-4F);
}

TEST(OrientationGrid, TakesTheBackgroundOffDownToNothing) {
  // Root brightness 0.2 on the left and 0.8 on the right; a background of 0.5, as when it is made or after.
  cv::Mat picture(64, 64, CV_8UC1, cv::Scalar(255 * 0.2 * 0.2));
  picture.colRange(32, 64).setTo(255 * 0.8 * 0.8);
  const std::array<float, 3> background{0.5F, 0.0F, 0.0F};
  OrientationGrid made;
  OrientationGridMaker(background).compute(picture, made);
  OrientationGrid later = map_of(picture);
  take_off(background, later);
  EXPECT_EQ(made.brightness, later.brightness);
  for (const int row : {OrientationGrid::pad, 10, OrientationGrid::pad + OrientationGrid::cells - 1}) {
    EXPECT_EQ(made.brightness_at(row, 5)[0], 0.0F);
    EXPECT_GT(made.brightness_at(row, 14)[0], 0.1F);
  }
  EXPECT_NEAR(made.brightness_at(10, 14)[0], 0.3F, 0.005F);
  EXPECT_EQ(made.brightness_at(1, 14)[0], 0.0F) << "nothing is taken off the frame";
}

TEST(OrientationGrid, HasTheMedianOfTheCornersAsBackgroundLevel) {
  std::vector<OrientationGrid> maps;
  for (const double level : {10.0, 90.0, 250.0}) {
    cv::Mat picture(64, 64, CV_8UC3, cv::Scalar(level, 40.0, level));
    picture(cv::Rect(8, 8, 48, 48)).setTo(cv::Scalar::all(255));
    maps.push_back(map_of(picture));
  }
  const auto found = background_level(maps);
  // The corner cells are blurred over their neighbours, which all show background too.
  EXPECT_NEAR(found[0], maps[1].brightness_at(2, 2)[0], 1e-6F);
  EXPECT_NEAR(found[1], maps[0].brightness_at(2, 2)[1], 1e-6F);
  EXPECT_EQ(background_level({}), (std::array<float, 3>{}));
}

TEST(OrientationGrid, RefusesAPictureThatIsNotSquare) {
  OrientationGridMaker mapper;
  OrientationGrid map;
  EXPECT_THROW(mapper.compute(cv::Mat(64, 60, CV_8UC1, cv::Scalar(0)), map), std::invalid_argument);
  EXPECT_THROW(mapper.compute(cv::Mat(64, 64, CV_32FC1, cv::Scalar(0)), map), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
