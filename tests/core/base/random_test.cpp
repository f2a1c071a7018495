#include "core/base/random.h"

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(SeededRandom, GivesTheNumbersOfTheStandardsGenerator) {
  // The first numbers of MT19937 with seed 1.
  constexpr double first = 1791095845.0;
  constexpr double second = 4282876139.0;
  SeededRandom random(1);
  EXPECT_EQ(random.unit(), first / 4294967296.0);
  EXPECT_EQ(random.unit(), second / 4294967296.0);
  SeededRandom again(1);
  EXPECT_EQ(again.symmetric(), first / 2147483648.0 - 1.0);
  EXPECT_EQ(again.below(1000), 139);
}

TEST(SeededRandom, StaysWithinItsBounds) {
  SeededRandom random(7);
  for (int i = 0; i < 100000; ++i) {
    const double unit = random.unit();
    EXPECT_TRUE(unit >= 0.0 && unit < 1.0);
    const double symmetric = random.symmetric();
    EXPECT_TRUE(symmetric >= -1.0 && symmetric < 1.0);
    const int below = random.below(3);
    EXPECT_TRUE(below >= 0 && below < 3);
  }
}

TEST(SeededRandom, IsNormalWithUnitVariance) {
  SeededRandom random(3);
  constexpr int count = 100000;
  double sum = 0.0;
  double squares = 0.0;
  int beyond_two = 0;
  for (int i = 0; i < count; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    beyond_two += std::abs(x) > 2.0 ? 1 : 0;
  }
  // Five standard errors each.
  EXPECT_NEAR(sum / count, 0.0, 5.0 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 1.0, 5.0 * std::sqrt(2.0 / count));
  EXPECT_NEAR(static_cast<double>(beyond_two) / count, 0.0455, 5.0 * std::sqrt(0.0455 / count));
}

}  // namespace
}  // namespace eigenpose
