#include "core/image/background.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

cv::Mat noisy(const cv::Scalar& level, double sigma, int type = CV_8UC1) {
  cv::Mat image(240, 320, type);
  cv::RNG(5).fill(image, cv::RNG::NORMAL, level, cv::Scalar::all(sigma));
  return image;
}

TEST(MeasureBackground, MeasuresLevelAndNoise) {
  for (const double sigma : {2.0, 5.0, 10.0}) {
    const Background background = measure_background(noisy(cv::Scalar(60), sigma), {});
    EXPECT_NEAR(background.level[0], 60, 1 + 0.25 * sigma) << sigma;
    // Some thousand samples, and the peak may lie beside the middle by a quarter of a sigma.
    EXPECT_NEAR(background.noise, sigma, 0.3 * sigma) << sigma;
  }
}

TEST(MeasureBackground, TheThresholdIsTheLeastContrastAboveAQuietBackground) {
  for (const int contrast : {1, 12, 40}) {
    const cv::Mat image(100, 100, CV_8UC1, cv::Scalar(30));
    EXPECT_EQ(measure_background(image, {.least_contrast = contrast}).threshold, 30 + contrast);
  }
}

TEST(MeasureBackground, TheCamerasNoiseRaisesTheThreshold) {
  for (const double sigma : {5.0, 10.0})
    for (const double sigmas : {3.0, 5.0, 7.0}) {
      const cv::Mat image = noisy(cv::Scalar(70), sigma);
      const Background background = measure_background(image, {.least_contrast = 1, .noise_sigmas = sigmas});
      EXPECT_NEAR(background.threshold - 70, sigmas * sigma, 0.35 * sigmas * sigma);
      EXPECT_LE(cv::countNonZero(image > background.threshold), sigmas >= 5.0 ? 5 : 800);
    }
  const cv::Mat image = noisy(cv::Scalar(70), 10.0);
  EXPECT_EQ(measure_background(image, {.least_contrast = 100, .noise_sigmas = 5.0}).threshold,
            measure_background(image, {.least_contrast = 100, .noise_sigmas = 0.0}).threshold)
      << "the larger of the two counts, not their sum";
}

TEST(MeasureBackground, ABrightObjectLeavesItAsItIs) {
  cv::Mat image = noisy(cv::Scalar(40), 3.0);
  const Background empty = measure_background(image, {});
  cv::rectangle(image, {30, 30, 180, 160}, cv::Scalar(190), cv::FILLED);
  const Background with = measure_background(image, {});
  EXPECT_NEAR(with.level[0], empty.level[0], 1);
  EXPECT_NEAR(with.threshold, empty.threshold, 2);
}

TEST(MeasureBackground, EachBandHasItsLevelAndTheBrightestTheThreshold) {
  const Background background =
      measure_background(cv::Mat(100, 100, CV_8UC3, cv::Scalar(10, 50, 30)), {.least_contrast = 12});
  EXPECT_EQ(background.level, (std::array<std::uint8_t, 3>{10, 50, 30}));
  EXPECT_EQ(background.color(), cv::Scalar(10, 50, 30));
  EXPECT_EQ(background.threshold, 62);
}

TEST(MeasureBackground, BlackWithNoiseCutOffAtZeroIsMeasuredByItsUpperSide) {
  const Background background = measure_background(noisy(cv::Scalar(0), 4.0), {.least_contrast = 1});
  EXPECT_LE(background.level[0], 2);
  EXPECT_GE(background.noise, 1.0);
}

TEST(MeasureBackground, TheThresholdLeavesRoomForAForeground) {
  EXPECT_EQ(measure_background(cv::Mat(50, 50, CV_8UC1, cv::Scalar(250)), {}).threshold, 254);
}

}  // namespace
}  // namespace eigenpose
