#include "tests/drivers/lamp_conformance.h"

#include <limits>
#include <stdexcept>

#include "core/base/error.h"

namespace eigenpose {

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(LampConformance);

namespace {

constexpr double one_step = 1.0 / 255.0;  ///< the coarsest dimmer there is has 8 bits

}  // namespace

TEST_P(LampConformance, DescribesItselfAndIsDarkAtFirst) {
  EXPECT_FALSE(lamp().info().name.empty());
  EXPECT_FALSE(lamp().info().model.empty());
  EXPECT_EQ(lamp().level(), 0.0);
  EXPECT_EQ(rig().truth(), 0.0);
}

TEST_P(LampConformance, ShowsEachLevelItIsGiven) {
  for (const double level : {1.0, 0.25, 0.0, 0.6}) {
    lamp().set_level(level, soon());
    EXPECT_NEAR(rig().truth(), level, one_step);
    EXPECT_EQ(lamp().level(), level);
  }
}

TEST_P(LampConformance, RefusesLevelsOutsideItsRangeAndKeepsTheOldOne) {
  lamp().set_level(0.5, soon());
  for (const double level : {-0.01, 1.01, std::numeric_limits<double>::quiet_NaN(), 1e9})
    EXPECT_THROW(lamp().set_level(level, soon()), std::out_of_range) << level;
  EXPECT_NEAR(rig().truth(), 0.5, one_step);
  EXPECT_EQ(lamp().level(), 0.5);
}

TEST_P(LampConformance, GoesDarkWhenItIsDestroyed) {
  lamp().set_level(1.0, soon());
  rig().discard_lamp();
  EXPECT_EQ(rig().truth(), 0.0);
}

TEST_P(LampConformance, DoesNothingAfterTheDeadline) {
  EXPECT_THROW(lamp().set_level(1.0, std::chrono::steady_clock::now() - std::chrono::seconds(1)),
               DeviceTimeout);
  EXPECT_EQ(rig().truth(), 0.0);
  EXPECT_EQ(lamp().level(), 0.0);
}

TEST_P(LampConformance, NamesALampThatDoesNotAnswerAndGoesOnWhenItDoes) {
  lamp().set_level(0.5, soon());
  rig().silence(true);
  EXPECT_THROW(lamp().set_level(1.0, soon()), DeviceError);
  EXPECT_EQ(lamp().level(), 0.5) << "the level last set, not the one that failed";
  rig().silence(false);
  lamp().set_level(1.0, soon());
  EXPECT_NEAR(rig().truth(), 1.0, one_step);
}

TEST_P(LampConformance, FindsALampAgainThatWasAway) {
  lamp().set_level(0.5, soon());
  rig().unplug();
  EXPECT_THROW(lamp().set_level(0.7, soon()), DeviceError);
  rig().plug_in();
  lamp().set_level(0.7, soon());
  EXPECT_NEAR(rig().truth(), 0.7, one_step);
}

TEST_P(LampConformance, CountsThatItsDeviceWasAwaySinceItWasLit) {
  lamp().set_level(0.5, soon());
  const std::uint64_t before = lamp().interruptions();
  rig().unplug();
  rig().plug_in();
  lamp().set_level(0.5, soon());
  EXPECT_GT(lamp().interruptions(), before) << "back within the retries of one call";
  EXPECT_NEAR(rig().truth(), 0.5, one_step);
}

TEST_P(LampConformance, CanBeDestroyedWhileTheLampIsAwayAndLeavesItAsItWas) {
  lamp().set_level(0.5, soon());
  rig().unplug();
  EXPECT_NO_THROW(rig().discard_lamp());
  rig().plug_in();
  EXPECT_NEAR(rig().truth(), 0.5, one_step) << "nobody could tell it to go dark";
}

}  // namespace eigenpose
