#include "core/color/chromaticity.h"

#include <cmath>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

using ::testing::Each;

cv::Mat plain(const cv::Scalar& bgr, int side = 64) {
  return {side, side, CV_8UC3, bgr};
}

/// One half of each colour.
cv::Mat halves(const cv::Scalar& left, const cv::Scalar& right) {
  cv::Mat picture = plain(left);
  picture.colRange(32, 64).setTo(right);
  return picture;
}

double distance(const cv::Mat& a, const cv::Mat& b) {
  return hellinger_distance(chromaticity_roots(chromaticity_map(a)), chromaticity_roots(chromaticity_map(b)));
}

TEST(ChromaticityMap, HoldsTheOpponentDifferencesOfEachPixel) {
  const auto expected = [](double difference, double brightness) {
    return std::lround(127.5 + 127.5 * difference / (std::abs(difference) + 0.3 * (brightness + 8.0)));
  };
  const ChromaticityMap map = chromaticity_map(plain({30, 60, 150}));
  EXPECT_THAT(map.brightness, Each(80));
  EXPECT_THAT(map.u, Each(expected(150 - 60, 80)));
  EXPECT_THAT(map.v, Each(expected(0.5 * (150 + 60) - 30, 80)));
}

TEST(ChromaticityMap, ShowsGreyAsTheMiddleAndOppositeColoursOnOppositeSides) {
  EXPECT_THAT(chromaticity_map(plain({90, 90, 90})).u, Each(128));
  EXPECT_THAT(chromaticity_map(plain({90, 90, 90})).v, Each(128));
  EXPECT_THAT(chromaticity_map(plain({0, 0, 200})).u, Each(::testing::Gt(200)));    // red
  EXPECT_THAT(chromaticity_map(plain({0, 200, 0})).u, Each(::testing::Lt(55)));     // green
  EXPECT_THAT(chromaticity_map(plain({0, 200, 200})).v, Each(::testing::Gt(200)));  // yellow
  EXPECT_THAT(chromaticity_map(plain({200, 0, 0})).v, Each(::testing::Lt(55)));     // blue
}

TEST(ChromaticityMap, IsOfThePictureInSixteenPixelsASide) {
  cv::Mat picture = plain({0, 0, 0}, 128);
  picture(cv::Rect(8, 16, 8, 8)).setTo(cv::Scalar(200, 200, 200));
  const ChromaticityMap map = chromaticity_map(picture);
  for (std::size_t i = 0; i < ChromaticityMap::pixels; ++i)
    EXPECT_EQ(map.brightness[i], i == 2 * 16 + 1 ? 200 : 0) << i;
}

TEST(ChromaticityMap, IsTheSameOfAPictureAndOfItsCopyInTheSizeOfWindows) {
  for (const int side : {8, 48, 100}) {
    cv::Mat picture(side, side, CV_8UC3);
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        picture.at<cv::Vec3b>(y, x) =
            cv::Vec3b(static_cast<std::uint8_t>(255 * x / side), static_cast<std::uint8_t>(255 * y / side),
                      static_cast<std::uint8_t>(255 * (x ^ y) / (2 * side)));
    cv::Mat copy;
    cv::resize(picture, copy, {64, 64}, 0.0, 0.0, cv::INTER_AREA);
    EXPECT_EQ(chromaticity_map(picture), chromaticity_map(copy)) << side;
  }
}

TEST(ChromaticityMap, TakesTheBackgroundOff) {
  const std::array<float, 3> background{std::sqrt(40.0F / 255.0F), std::sqrt(20.0F / 255.0F), 0.0F};
  EXPECT_EQ(chromaticity_map(plain({140, 120, 100}), background), chromaticity_map(plain({100, 100, 100})));
  EXPECT_THAT(chromaticity_map(plain({30, 10, 0}), background).brightness, Each(0)) << "no less than none";
}

TEST(ChromaticityRoots, AreAUnitVectorOrZeros) {
  const ChromaticityRoots some = chromaticity_roots(chromaticity_map(halves({10, 60, 200}, {90, 90, 30})));
  EXPECT_NEAR(std::inner_product(some.begin(), some.end(), some.begin(), 0.0), 1.0, 1e-6);
  EXPECT_THAT(chromaticity_roots(chromaticity_map(plain({0, 0, 0}))), Each(0.0F));
}

TEST(ChromaticityRoots, CountPixelsByTheirBrightness) {
  // Twice as many pixels of one colour weigh as much as one of twice the brightness.
  ChromaticityMap many;
  many.u.fill(40);
  many.v.fill(200);
  many.brightness.fill(0);
  ChromaticityMap bright = many;
  many.brightness[0] = many.brightness[1] = many.brightness[2] = 60;
  bright.brightness[0] = 120;
  bright.brightness[2] = 60;
  many.u[2] = bright.u[2] = 220;
  EXPECT_NEAR(hellinger_distance(chromaticity_roots(many), chromaticity_roots(bright)), 0.0, 1e-6);
}

TEST(ChromaticityRoots, OfAPartAreThoseOfThatPartAlone) {
  const ChromaticityMap both = chromaticity_map(halves({10, 60, 200}, {200, 60, 10}));
  std::vector<float> left(ChromaticityMap::pixels, 0.0F);
  for (std::size_t i = 0; i < left.size(); ++i)
    if (i % 16 < 8) left[i] = 1.0F;
  const ChromaticityRoots alone = chromaticity_roots(chromaticity_map(plain({10, 60, 200})));
  EXPECT_NEAR(hellinger_distance(chromaticity_roots(both, left), alone), 0.0, 1e-6);
  EXPECT_GT(hellinger_distance(chromaticity_roots(both), alone), 0.4);
}

TEST(HellingerDistance, IsZeroForTheSameAndOneForNothingInCommon) {
  EXPECT_EQ(distance(plain({10, 60, 200}), plain({10, 60, 200})), 0.0);
  EXPECT_NEAR(distance(plain({0, 0, 200}), plain({200, 0, 0})), 1.0, 1e-6);
}

TEST(HellingerDistance, IsOneWhereNothingIsBright) {
  EXPECT_EQ(distance(plain({0, 0, 0}), plain({0, 0, 200})), 1.0);
  EXPECT_EQ(distance(plain({0, 0, 0}), plain({0, 0, 0})), 1.0) << "black says nothing of an object";
}

TEST(HellingerDistance, IsTheOneOfTheFrequencies) {
  // Frequencies (1, 0) and (½, ½): √(1 − √½).
  EXPECT_NEAR(distance(plain({0, 0, 200}), halves({0, 0, 200}, {66, 0, 0})),
              std::sqrt(1.0 - std::sqrt(200.0 / 266.0)), 2e-3);
}

TEST(HellingerDistance, HardlyChangesWithGainAndNotWithWhereColoursAre) {
  const cv::Mat picture = halves({20, 60, 220}, {160, 120, 60});
  EXPECT_LT(distance(picture, 0.8 * picture), 0.1);
  EXPECT_GT(distance(picture, halves({60, 60, 60}, {160, 120, 60})), 0.3);
  EXPECT_NEAR(distance(picture, halves({160, 120, 60}, {20, 60, 220})), 0.0, 1e-6);
}

}  // namespace
}  // namespace eigenpose
