#include "core/learning/calibration/perturbation.h"

#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

TEST(Perturbation, DrawsWithinItsBoundsAndUsesAllOfThem) {
  const Perturbation bounds{.shift = 0.02, .scale = 0.03, .turn_deg = 4.0};
  SeededRandom random(1);
  Misalignment most{0, -1, -1, -1, -1};
  Misalignment least{0, 1, 1, 1, 1};
  for (int i = 0; i < 2000; ++i) {
    const Misalignment m = bounds.draw(random);
    EXPECT_EQ(m.gain, 0.0);
    most = {0.0, std::max(most.dx, m.dx), std::max(most.dy, m.dy), std::max(most.scale, m.scale),
            std::max(most.rotation, m.rotation)};
    least = {0.0, std::min(least.dx, m.dx), std::min(least.dy, m.dy), std::min(least.scale, m.scale),
             std::min(least.rotation, m.rotation)};
  }
  const double turn = 4.0 * std::numbers::pi / 180.0;
  for (const auto& [low, high, bound] :
       {std::tuple{least.dx, most.dx, 0.02}, std::tuple{least.dy, most.dy, 0.02},
        std::tuple{least.scale, most.scale, 0.03}, std::tuple{least.rotation, most.rotation, turn}}) {
    EXPECT_LE(high, bound);
    EXPECT_GE(low, -bound);
    EXPECT_GT(high, 0.98 * bound);
    EXPECT_LT(low, -0.98 * bound);
  }
}

TEST(Perturbation, IsTheSameForTheSameSeed) {
  const Perturbation bounds{.shift = 0.02, .scale = 0.03, .turn_deg = 4.0};
  SeededRandom a(5);
  SeededRandom b(5);
  SeededRandom c(6);
  const Misalignment first = bounds.draw(a);
  EXPECT_EQ(first.dx, bounds.draw(b).dx);
  EXPECT_NE(first.dx, bounds.draw(c).dx);
  EXPECT_NE(first.dx, bounds.draw(a).dx) << "each draw is another";
}

/// A spot at (x, y).
cv::Mat spot(double x, double y) {
  cv::Mat picture(64, 64, CV_8UC1);
  for (int r = 0; r < 64; ++r)
    for (int c = 0; c < 64; ++c)
      picture.at<std::uint8_t>(r, c) = static_cast<std::uint8_t>(
          std::lround(250.0 * std::exp(-((c - x) * (c - x) + (r - y) * (r - y)) / 18.0)));
  return picture;
}

cv::Point2d centre(const cv::Mat& picture) {
  const cv::Moments m = cv::moments(picture);
  return {m.m10 / m.m00, m.m01 / m.m00};
}

TEST(Displaced, MovesEnlargesAndTurnsAboutTheMiddle) {
  const cv::Mat picture = spot(41.5, 31.5);  // 10 pixels to the right of the middle
  const auto moved = [&](const Misalignment& by) { return centre(displaced(picture, by)); };
  EXPECT_NEAR(moved({0.0, 0.05, 0.0, 0.0, 0.0}).x, 41.5 + 3.2, 0.1);
  EXPECT_NEAR(moved({0.0, 0.0, -0.05, 0.0, 0.0}).y, 31.5 - 3.2, 0.1);
  EXPECT_NEAR(moved({0.0, 0.0, 0.0, 0.2, 0.0}).x, 31.5 + 12.0, 0.1);
  const cv::Point2d turned = moved({0.0, 0.0, 0.0, 0.0, 0.5});
  EXPECT_NEAR(turned.x, 31.5 + 10.0 * std::cos(0.5), 0.1);
  EXPECT_NEAR(turned.y, 31.5 + 10.0 * std::sin(0.5), 0.1);
}

TEST(Displaced, MakesNoRangesThatWereNotMeasured) {
  cv::Mat range(32, 32, CV_16UC1, cv::Scalar(0));
  range(cv::Rect(8, 8, 16, 16)).setTo(1000);
  const cv::Mat moved = displaced(range, {0.0, 0.02, 0.013, 0.01, 0.03});
  EXPECT_EQ(cv::countNonZero((moved != 0) & (moved != 1000)), 0);
}

TEST(Perturbation, OfAViewIsTheSameAgainAndAnotherForEachViewAndObject) {
  const Perturbation perturbation{.shift = 1.0, .scale = 1.0, .turn_deg = 1.0};
  EXPECT_EQ(perturbation.of("duck", 3).dx, perturbation.of("duck", 3).dx);
  EXPECT_NE(perturbation.of("duck", 3).dx, perturbation.of("duck", 4).dx);
  EXPECT_NE(perturbation.of("duck", 3).dx, perturbation.of("mug", 3).dx);
  EXPECT_NE(seed_of("ab", 0), seed_of("ba", 0));
}

TEST(Perturbed, TintsRedAndBlueWithinTheBoundOfEachViewAlike) {
  const cv::Mat picture(8, 8, CV_8UC3, cv::Scalar(200, 200, 200));
  const Perturbation by{.tint = 0.1};
  std::set<int> blues;
  std::set<int> reds;
  for (std::size_t view = 0; view < 40; ++view) {
    const cv::Mat tinted = perturbed(picture, by, "duck", view);
    const auto pixel = tinted.at<cv::Vec3b>(3, 5);
    EXPECT_EQ(pixel[1], 200) << "green stays";
    EXPECT_NEAR(pixel[0], 200, 20);
    EXPECT_NEAR(pixel[2], 200, 20);
    blues.insert(pixel[0]);
    reds.insert(pixel[2]);
    EXPECT_EQ(cv::norm(tinted, perturbed(picture, by, "duck", view), cv::NORM_INF), 0.0) << "the same again";
  }
  EXPECT_LT(*blues.begin(), 190);
  EXPECT_GT(*blues.rbegin(), 210);
  EXPECT_LT(*reds.begin(), 190);
  EXPECT_GT(*reds.rbegin(), 210);
}

TEST(Perturbed, DisplacesAsTheDrawOfTheViewSaysAndLeavesGreyAsItIs) {
  cv::Mat picture(32, 32, CV_8UC1);
  cv::RNG(5).fill(picture, cv::RNG::UNIFORM, 0, 255);
  const Perturbation by{.shift = 0.05, .scale = 0.03, .turn_deg = 4.0, .tint = 0.1};
  EXPECT_EQ(cv::norm(perturbed(picture, by, "duck", 7), displaced(picture, by.of("duck", 7)), cv::NORM_INF),
            0.0);
  cv::Mat color;
  cv::cvtColor(picture, color, cv::COLOR_GRAY2BGR);
  const Perturbation untinted{.shift = 0.05, .scale = 0.03, .turn_deg = 4.0};
  EXPECT_EQ(cv::norm(perturbed(color, untinted, "duck", 7), displaced(color, by.of("duck", 7)), cv::NORM_INF),
            0.0);
}

}  // namespace
}  // namespace eigenpose
