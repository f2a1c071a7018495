#include "core/image/appearance_maker.h"

#include <cmath>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

NormalizationOptions of_type(const std::string& type) {
  NormalizationOptions options;
  options.size = 8;
  set_image_type(options, type);
  return options;
}

std::vector<float> waves(std::size_t count) {
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = 20.0F + 10.0F * std::sin(0.7F * static_cast<float>(i));
  return values;
}

float length_of(const std::vector<float>& values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0F));
}

TEST(AppearanceMaker, GreyIsThePictureItself) {
  const NormalizationOptions options = of_type("grey");
  AppearanceMaker maker(options);
  EXPECT_TRUE(maker.is_picture());
  const std::vector<float> picture = waves(picture_length(options));
  std::vector<float> appearance(appearance_length(options));
  EXPECT_NEAR(maker.make(picture, appearance), length_of(picture), 1e-4F * length_of(picture));
  EXPECT_EQ(appearance, picture);
}

TEST(AppearanceMaker, ColorIsBrightnessAndTwoOpponentAxesThatCountThreeTimes) {
  const NormalizationOptions options = of_type("color");
  AppearanceMaker maker(options);
  EXPECT_FALSE(maker.is_picture());
  std::vector<float> picture(picture_length(options), 0.0F);
  std::vector<float> appearance(appearance_length(options));
  // Blue, green, red; white; then one that has the same energy whichever axis it lies on, but for the weight.
  picture[0] = 1.0F;
  picture[4] = 1.0F;
  picture[8] = 1.0F;
  for (std::size_t i = 9; i < 12; ++i) picture[i] = 2.0F;
  picture[13] = -1.0F;
  picture[14] = 1.0F;
  maker.make(picture, appearance);
  const float a = 1.0F / std::sqrt(3.0F), b = 3.0F / std::sqrt(2.0F), c = 3.0F / std::sqrt(6.0F);
  const std::vector<float> expected{a,  0.0F,     2.0F * c, a,    -b,   -c,       a,   b,
                                    -c, 6.0F * a, 0.0F,     0.0F, 0.0F, 2.0F * b, 0.0F};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(appearance[i], expected[i], 1e-5F) << i;
}

TEST(AppearanceMaker, ReturnsTheEnergyOfWhatItMade) {
  for (const char* type : {"gradient", "laplacian", "fourier", "grey+gradient", "color:0.7+fourier:0.3"}) {
    const NormalizationOptions options = of_type(type);
    AppearanceMaker maker(options);
    EXPECT_FALSE(maker.is_picture()) << type;
    std::vector<float> appearance(appearance_length(options));
    const float energy = maker.make(waves(picture_length(options)), appearance);
    EXPECT_NEAR(energy, length_of(appearance), 1e-4F * energy) << type;
  }
}

TEST(AppearanceMaker, TheWeightsOfASumAreSharesOfTheSquaredEnergy) {
  const NormalizationOptions options = of_type("grey:3+gradient:1");
  AppearanceMaker maker(options);
  std::vector<float> appearance(appearance_length(options));
  maker.make(waves(picture_length(options)), appearance);
  double grey = 0.0, gradient = 0.0;
  for (std::size_t i = 0; i < appearance.size(); i += 2) {
    grey += static_cast<double>(appearance[i]) * appearance[i];
    gradient += static_cast<double>(appearance[i + 1]) * appearance[i + 1];
  }
  EXPECT_NEAR(grey, 0.75, 1e-5);
  EXPECT_NEAR(gradient, 0.25, 1e-5);
}

TEST(AppearanceMaker, BlackHasNoEnergyAndNoNumbersThatAreNone) {
  for (const char* type : {"grey", "gradient", "fourier", "grey+laplacian"}) {
    const NormalizationOptions options = of_type(type);
    std::vector<float> appearance(appearance_length(options), 7.0F);
    EXPECT_EQ(AppearanceMaker(options).make(std::vector<float>(picture_length(options)), appearance), 0.0F)
        << type;
    for (const float value : appearance) EXPECT_EQ(value, 0.0F) << type;
  }
}

TEST(AppearanceMaker, RefusesATypeThatIsNotKnown) {
  NormalizationOptions options;
  options.type = "sepia";
  EXPECT_THROW(AppearanceMaker{options}, std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
