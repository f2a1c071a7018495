#include "core/image/image_type.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>

#include "core/image/appearance_maker.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr int side = 32;
constexpr float sum_rounding = 1e-4F;  ///< of sums of some grey levels in float

NormalizationOptions options_of(const std::string& type) {
  NormalizationOptions options;
  options.size = side;
  set_image_type(options, type);
  return options;
}

std::vector<float> grey_picture(const std::function<float(int, int)>& value) {
  std::vector<float> picture;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) picture.push_back(value(x, y));
  return picture;
}

/// A picture without symmetry.
float bumps(int x, int y) {
  const auto bump = [&](float cx, float cy, float width) {
    const float dx = static_cast<float>(x) - cx;
    const float dy = static_cast<float>(y) - cy;
    return std::exp(-(dx * dx + dy * dy) / (2.0F * width * width));
  };
  return 200.0F * bump(9, 12, 3) + 120.0F * bump(20, 18, 5) + 30.0F;
}

std::vector<float> made(const std::string& type, const std::vector<float>& picture) {
  AppearanceMaker maker(options_of(type));
  std::vector<float> appearance(appearance_length(options_of(type)));
  maker.make(picture, appearance);
  return appearance;
}

double energy(std::span<const float> numbers) {
  return std::sqrt(std::inner_product(numbers.begin(), numbers.end(), numbers.begin(), 0.0));
}

TEST(ImageType, GradientOfARampIsItsSlopeEverywhere) {
  const auto appearance = made("gradient", grey_picture([](int x, int y) { return 3.0F * x + 4.0F * y; }));
  for (const float value : appearance) EXPECT_NEAR(value, 5.0F, sum_rounding);
}

TEST(ImageType, GradientIsTheSameOnAPictureTurnedByAQuarter) {
  const auto straight = made("gradient", grey_picture(bumps));
  const auto turned = made("gradient", grey_picture([](int x, int y) { return bumps(y, side - 1 - x); }));
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      ASSERT_NEAR(turned[static_cast<std::size_t>(y * side + x)],
                  straight[static_cast<std::size_t>((side - 1 - x) * side + y)], sum_rounding);
}

TEST(ImageType, LaplacianOfAPlaneIsZeroAndOfAParabolaConstant) {
  for (const float value :
       made("laplacian", grey_picture([](int x, int y) { return 2.0F * x + 5.0F * y + 7.0F; })))
    EXPECT_NEAR(value, 0.0F, sum_rounding);
  const auto bowl = made("laplacian", grey_picture([](int x, int y) { return 0.25F * (x * x + y * y); }));
  for (int y = 1; y + 1 < side; ++y)
    for (int x = 1; x + 1 < side; ++x)
      EXPECT_NEAR(bowl[static_cast<std::size_t>(y * side + x)], 1.0F, sum_rounding);
}

TEST(ImageType, FourierMagnitudeDoesNotChangeWhenThePictureIsShiftedAround) {
  const auto straight = made("fourier", grey_picture(bumps));
  const auto shifted =
      made("fourier", grey_picture([](int x, int y) { return bumps((x + 11) % side, (y + 5) % side); }));
  // The root of a magnitude near 0 turns rounding of 1e-4 into 1e-2.
  for (std::size_t i = 0; i < straight.size(); ++i) EXPECT_NEAR(shifted[i], straight[i], 0.05F);
  EXPECT_GT(energy(straight), 100.0);
  const auto other = made("fourier", grey_picture([](int x, int y) { return bumps(x, (2 * y) % side); }));
  std::vector<float> difference(straight.size());
  std::transform(straight.begin(), straight.end(), other.begin(), difference.begin(), std::minus<>());
  EXPECT_GT(energy(difference), 10.0) << "another picture has another spectrum";
}

TEST(ImageType, BrightnessCancelsOutOfEveryTypeOnceOfUnitEnergy) {
  const auto picture = grey_picture(bumps);
  auto brighter = picture;
  for (float& value : brighter) value *= 1.7F;
  for (const std::string type : {"grey", "gradient", "laplacian", "fourier", "grey+gradient+fourier"}) {
    const auto a = made(type, picture);
    const auto b = made(type, brighter);
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i] / energy(a), b[i] / energy(b), 1e-5) << type;
  }
}

TEST(ImageType, SumsShareTheEnergyAsTheirWeightsSay) {
  const auto picture = grey_picture(bumps);
  const auto sum = made("grey:3+gradient:1", picture);
  ASSERT_EQ(sum.size(), 2U * side * side);
  double grey = 0.0;
  double gradient = 0.0;
  for (std::size_t i = 0; i < sum.size(); i += 2) {
    grey += static_cast<double>(sum[i]) * sum[i];
    gradient += static_cast<double>(sum[i + 1]) * sum[i + 1];
  }
  EXPECT_NEAR(grey, 0.75, 1e-5);
  EXPECT_NEAR(gradient, 0.25, 1e-5);
  const auto alone = made("grey", picture);
  EXPECT_NEAR(sum[200] / std::sqrt(0.75), alone[100] / energy(alone), 1e-5)
      << "numbers of a pixel stand together";
}

TEST(ImageType, ColourTypesTakeTheBrightnessOfThreeBands) {
  NormalizationOptions options = options_of("color+gradient");
  EXPECT_TRUE(options.color);
  EXPECT_EQ(appearance_bands(options), 4);
  std::vector<float> picture;
  for (int i = 0; i < side * side; ++i)
    for (const float band : {10.0F, 20.0F, 30.0F}) picture.push_back(band * static_cast<float>(i % side));
  std::vector<float> gradient(static_cast<std::size_t>(side) * side);
  NormalizationOptions plain = options;
  plain.type = "gradient";
  AppearanceMaker(plain).make(picture, gradient);
  EXPECT_NEAR(gradient[100], 0.114F * 10 + 0.587F * 20 + 0.299F * 30, 1e-3);
}

TEST(ImageType, RangeKeepsItsFullDepthFromTheFileAndNotMeasuredIsZero) {
  cv::Mat depth(side, side, CV_16UC1);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(40000 + y * side + x);
  depth.at<std::uint16_t>(3, 4) = 0;
  const auto file = std::filesystem::path(::testing::TempDir()) / "eigenpose_range_test.png";
  const auto png = encode_png(depth);
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  const cv::Mat read = load_picture(file);
  std::filesystem::remove(file);
  Normalizer normalizer(options_of("range"));
  std::vector<float> picture(normalizer.length());
  normalizer.normalize(read, {0, 0, 0}, picture);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      ASSERT_EQ(picture[static_cast<std::size_t>(y * side + x)],
                x == 4 && y == 3 ? 0.0F : static_cast<float>(40000 + y * side + x));
}

TEST(ImageType, WhatWasNotMeasuredTakesNoPartInTheMeansOfRange) {
  cv::Mat depth(2 * side, 2 * side, CV_16UC1, cv::Scalar(1000));
  depth.at<std::uint16_t>(0, 0) = 0;       // a quarter of the first output pixel
  depth(cv::Rect(10, 10, 3, 2)).setTo(0);  // all of one, half of the next
  Normalizer normalizer(options_of("range"));
  std::vector<float> picture(normalizer.length());
  normalizer.normalize(depth, {0, 0, 0}, picture);
  EXPECT_FLOAT_EQ(picture[0], 1000.0F);
  EXPECT_EQ(picture[5 * side + 5], 0.0F);
  EXPECT_FLOAT_EQ(picture[5 * side + 6], 1000.0F);
}

TEST(ImageType, RangeRefusesPicturesOfEightBits) {
  Normalizer normalizer(options_of("range"));
  std::vector<float> picture(normalizer.length());
  EXPECT_THAT(
      [&] {
        normalizer.normalize(cv::Mat(40, 40, CV_8UC1, cv::Scalar(9)), {0, 0, 0}, picture);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("learned from range")));
}

TEST(ImageType, AnUnknownNameIsRefusedWithTheKnownOnes) {
  EXPECT_THAT([] { parse_image_type("grey+edges"); },
              ThrowsMessage<std::invalid_argument>(AllOf(
                  HasSubstr("\"edges\""), HasSubstr("grey, color, gradient, laplacian, fourier, range"))));
  EXPECT_THROW(parse_image_type(""), std::invalid_argument);
  EXPECT_THROW(parse_image_type("grey+"), std::invalid_argument);
}

TEST(ImageType, SumsThatMakeNoSenseAreRefused) {
  for (const char* text :
       {"grey:0", "grey:-1", "grey:x", "grey:nan", "grey+grey", "grey+range", "color+grey"})
    EXPECT_THROW(parse_image_type(text), std::invalid_argument) << text;
}

TEST(ImageType, EveryRowOfTheTableMakesAsManyNumbersAsItSays) {
  for (const ImageTypeRow& row : image_types()) {
    const auto options = options_of(std::string(row.name));
    const std::vector<float> picture(picture_length(options), 1.0F);
    std::vector<float> appearance(static_cast<std::size_t>(side * side * row.bands), -1.0F);
    row.make(side)->make({picture, side, picture_bands(options)}, appearance);
    EXPECT_EQ(appearance.size(), appearance_length(options)) << row.name;
    EXPECT_THAT(appearance, ::testing::Each(::testing::Ge(0.0F))) << row.name << " of a flat picture";
  }
}

}  // namespace
}  // namespace eigenpose
