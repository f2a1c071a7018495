#include "core/base/angle.h"

#include <cmath>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Angle, ConvertsBothWays) {
  EXPECT_DOUBLE_EQ(degrees(180).radians(), std::numbers::pi);
  EXPECT_DOUBLE_EQ(radians(std::numbers::pi / 2).degrees(), 90.0);
  EXPECT_DOUBLE_EQ((degrees(30) + degrees(60)) / degrees(45), 2.0);
}

TEST(Angle, WrapsIntoTheHalfOpenRange) {
  EXPECT_DOUBLE_EQ(wrap(360.0, 0.0, 360.0), 0.0);
  EXPECT_DOUBLE_EQ(wrap(-90.0, 0.0, 360.0), 270.0);
  EXPECT_DOUBLE_EQ(wrap(725.0, 0.0, 360.0), 5.0);
  EXPECT_DOUBLE_EQ(wrap(190.0, -180.0, 360.0), -170.0);
  // The value nearest below zero rounds to the excluded end unless that is guarded against.
  const double tiny = wrap(-1e-17, 0.0, 360.0);
  EXPECT_GE(tiny, 0.0);
  EXPECT_LT(tiny, 360.0);
}

TEST(Angle, DifferenceGoesTheShortWayRound) {
  EXPECT_NEAR(circular_difference(degrees(350), degrees(10)).degrees(), -20.0, 1e-12);
  EXPECT_NEAR(circular_difference(degrees(10), degrees(350)).degrees(), 20.0, 1e-12);
  EXPECT_NEAR(std::abs(circular_difference(degrees(0), degrees(180)).degrees()), 180.0, 1e-12);
}

}  // namespace
}  // namespace eigenpose
