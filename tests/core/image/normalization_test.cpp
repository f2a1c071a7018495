#include "core/image/normalization.h"

#include <numeric>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

/// Float sums of at most 256 terms of 8-bit values.
constexpr float rounding = 1e-3F;

NormalizationOptions grey(int size) {
  NormalizationOptions options;
  options.size = size;
  options.color = false;
  return options;
}

NormalizationOptions colour(int size) {
  NormalizationOptions options = grey(size);
  options.color = true;
  return options;
}

cv::Mat noise(int rows, int cols, int type) {
  cv::Mat image(rows, cols, type);
  cv::RNG(19).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

std::vector<float> appearance_of(const cv::Mat& cut, const NormalizationOptions& options,
                                 std::array<std::uint8_t, 3> level = {0, 0, 0}) {
  Normalizer normalizer(options);
  std::vector<float> appearance(normalizer.length());
  normalizer.normalize(cut, level, appearance);
  return appearance;
}

TEST(Normalizer, LeavesAPictureOfTheRightSizeAsItIs) {
  const cv::Mat image = noise(64, 64, CV_8UC3);
  const auto appearance = appearance_of(image, colour(64));
  for (std::size_t i = 0; i < appearance.size(); ++i) ASSERT_NEAR(appearance[i], image.data[i], rounding);
}

TEST(Normalizer, AveragesAreasLikeOpenCvWhereItIsExact) {
  for (const int factor : {2, 3, 5}) {
    const cv::Mat image = noise(32 * factor, 32 * factor, CV_8UC1);
    cv::Mat floats;
    image.convertTo(floats, CV_32F);
    cv::Mat expected;
    cv::resize(floats, expected, {32, 32}, 0, 0, cv::INTER_AREA);
    const auto appearance = appearance_of(image, grey(32));
    for (int i = 0; i < 32 * 32; ++i)
      ASSERT_NEAR(appearance[static_cast<std::size_t>(i)], expected.at<float>(i / 32, i % 32), rounding)
          << factor;
  }
}

TEST(Normalizer, KeepsTheMeanAtAnyScale) {
  for (const int side : {47, 64, 100, 173}) {
    const cv::Mat image = noise(side, side, CV_8UC1);
    const auto appearance = appearance_of(image, grey(32));
    const double mean =
        std::accumulate(appearance.begin(), appearance.end(), 0.0) / static_cast<double>(appearance.size());
    EXPECT_NEAR(mean, cv::mean(image)[0], 0.01) << side;
  }
}

TEST(Normalizer, KeepsTheAspectAndPutsBackgroundAround) {
  const cv::Mat image(20, 60, CV_8UC1, cv::Scalar(100));
  const auto appearance = appearance_of(image, grey(30));
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 30; ++x)
      EXPECT_NEAR(appearance[static_cast<std::size_t>(y * 30 + x)], y >= 10 && y < 20 ? 100.0F : 0.0F,
                  rounding)
          << x << "," << y;
}

TEST(Normalizer, SubtractsTheBackgroundOfEachBandAndNotBelowZero) {
  cv::Mat image(8, 8, CV_8UC3, cv::Scalar(30, 20, 10));
  const auto appearance = appearance_of(image, colour(8), {10, 5, 40});
  EXPECT_NEAR(appearance[0], 20.0F, rounding);
  EXPECT_NEAR(appearance[1], 15.0F, rounding);
  EXPECT_NEAR(appearance[2], 0.0F, rounding);
}

TEST(Normalizer, AGreyModelTakesColourButNotTheOtherWayRound) {
  const cv::Mat image(16, 16, CV_8UC3, cv::Scalar(10, 100, 200));
  const auto appearance = appearance_of(image, grey(16));
  EXPECT_NEAR(appearance[5], 0.114F * 10 + 0.587F * 100 + 0.299F * 200, 0.01F);
  Normalizer color(colour(16));
  std::vector<float> out(color.length());
  EXPECT_THROW(color.normalize(cv::Mat(16, 16, CV_8UC1, cv::Scalar(1)), {0, 0, 0}, out),
               std::invalid_argument);
  EXPECT_THROW(Normalizer(grey(4)), std::invalid_argument);
}

TEST(Normalizer, ReturnsTheEnergyAndZeroForBlack) {
  Normalizer normalizer(grey(16));
  std::vector<float> out(normalizer.length());
  EXPECT_NEAR(normalizer.normalize(cv::Mat(16, 16, CV_8UC1, cv::Scalar(3)), {0, 0, 0}, out), 3.0F * 16,
              0.01F);
  EXPECT_EQ(normalizer.normalize(cv::Mat(16, 16, CV_8UC1, cv::Scalar(3)), {5, 0, 0}, out), 0.0F);
}

TEST(Normalizer, ARangePixelCountsWhereHalfOfItsAreaWasMeasured) {
  NormalizationOptions options = grey(8);
  set_image_type(options, "range");
  // Each pixel of the appearance is the mean of two by two; 0 is not measured.
  cv::Mat distances = cv::Mat::zeros(16, 16, CV_16UC1);
  for (int measured = 0; measured <= 4; ++measured)
    for (int i = 0; i < measured; ++i)
      distances.at<std::uint16_t>(i / 2, 2 * measured + i % 2) = static_cast<std::uint16_t>(1000 + 100 * i);
  const auto appearance = appearance_of(distances, options);
  const std::array expected{0.0F, 0.0F, 1050.0F, 1100.0F, 1150.0F};
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR(appearance[i], expected.at(i), 0.1F) << i << " of 4 measured";
}

TEST(Quantize, FillsTheRangeSoThatADimPictureKeepsItsShape) {
  const std::vector<float> dim{0.0F, 0.5F, 1.0F, 2.0F};
  std::vector<std::uint8_t> bytes(4);
  quantize(dim, bytes);
  EXPECT_THAT(bytes, ::testing::ElementsAre(0, 64, 128, 255));
}

TEST(ShrinkAppearance, IsTheAreaMeanForAnySize) {
  for (const auto& [size, side] :
       {std::pair(64, 32), std::pair(96, 32), std::pair(50, 32), std::pair(40, 32)}) {
    const cv::Mat image = noise(size, size, CV_8UC3);
    cv::Mat floats;
    image.convertTo(floats, CV_32F);
    cv::Mat expected;
    cv::resize(floats, expected, {side, side}, 0, 0, cv::INTER_AREA);
    std::vector<float> reduced(static_cast<std::size_t>(side * side * 3));
    shrink_appearance({reinterpret_cast<const float*>(floats.data), floats.total() * 3}, size, 3, side,
                      reduced);
    for (std::size_t i = 0; i < reduced.size(); ++i)
      ASSERT_NEAR(reduced[i], reinterpret_cast<const float*>(expected.data)[i], rounding) << size;
  }
}

}  // namespace
}  // namespace eigenpose
