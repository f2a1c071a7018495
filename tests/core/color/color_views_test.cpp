#include "core/color/color_views.h"

#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

ChromaticityMap of_color(const cv::Scalar& bgr) {
  return chromaticity_map(cv::Mat(64, 64, CV_8UC3, bgr));
}

const ChromaticityMap red = of_color({20, 20, 200});
const ChromaticityMap orange = of_color({20, 90, 200});
const ChromaticityMap blue = of_color({200, 60, 20});

TEST(ColorViews, MeasureToTheNearestView) {
  const ColorViews views({blue, red});
  EXPECT_EQ(views.distance(chromaticity_roots(red)), 0.0);
  EXPECT_EQ(views.distance(chromaticity_roots(orange)),
            hellinger_distance(chromaticity_roots(orange), chromaticity_roots(red)));
}

TEST(ColorViews, LeaveViewsOut) {
  const ColorViews views({blue, red, red});
  const std::vector<int> one{1};
  const std::vector<int> both{1, 2};
  const std::vector<int> all{0, 1, 2};
  EXPECT_EQ(views.distance(chromaticity_roots(red), one), 0.0) << "another view is like it";
  EXPECT_NEAR(views.distance(chromaticity_roots(orange), both),
              hellinger_distance(chromaticity_roots(orange), chromaticity_roots(blue)), 1e-6);
  EXPECT_EQ(views.distance(chromaticity_roots(red), all), 1.0);
  EXPECT_EQ(ColorViews().distance(chromaticity_roots(red)), 1.0);
}

TEST(ColorViews, CompareTheVisiblePartWithTheSamePartOfTheViews) {
  // Above red, below blue; a region whose lower half is hidden by orange.
  ChromaticityMap view = red;
  ChromaticityMap region = red;
  std::vector<float> visible(ChromaticityMap::pixels, 1.0F);
  for (std::size_t i = ChromaticityMap::pixels / 2; i < ChromaticityMap::pixels; ++i) {
    view.u[i] = blue.u[i];
    view.v[i] = blue.v[i];
    region.u[i] = orange.u[i];
    region.v[i] = orange.v[i];
    visible[i] = 0.0F;
  }
  const ColorViews views({view});
  EXPECT_EQ(views.distance(region, visible), 0.0);
  EXPECT_GT(views.distance(chromaticity_roots(region)), 0.3) << "all of it";
  const int only = 0;
  EXPECT_EQ(views.distance(region, visible, {&only, 1}), 1.0);
}

TEST(ColorViews, KeepTheirMaps) {
  const ColorViews views({blue, orange});
  ASSERT_EQ(views.maps().size(), 2U);
  EXPECT_EQ(views.maps()[0], blue);
  EXPECT_EQ(views.maps()[1], orange);
}

}  // namespace
}  // namespace eigenpose
