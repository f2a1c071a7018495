#include "sim/modbus/az_drive.h"

#include <vector>

#include <gtest/gtest.h>

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned home_end = 1U << 4U;
constexpr unsigned ready = 1U << 5U;
constexpr unsigned alarmed = 1U << 7U;
constexpr unsigned moving = 1U << 13U;
constexpr unsigned in_position = 1U << 14U;

struct Drive : testing::Test {
  ManualClock clock{TimePoint(seconds(500))};
  SimLab lab{clock};
  AzDrive drive{lab, DriveOptions{}, 1.0};

  std::int32_t value(std::uint16_t address) {
    std::uint16_t words[2] = {};
    EXPECT_EQ(drive.read(address, words), ModbusException::none);
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(words[0]) << 16U | words[1]);
  }
  unsigned output() { return static_cast<unsigned>(value(0x007E)); }
  ModbusException set(std::uint16_t address, std::int32_t number) {
    const std::uint16_t words[2] = {static_cast<std::uint16_t>(static_cast<std::uint32_t>(number) >> 16U),
                                    static_cast<std::uint16_t>(number)};
    return drive.write(address, words);
  }
  ModbusException input(unsigned bits) { return set(0x007C, static_cast<std::int32_t>(bits)); }
  /// Direct data operation in one write, as a driver does it.
  ModbusException go(std::int32_t type, std::int32_t position, std::int32_t speed = 9000,
                     std::int32_t rate = 36000) {
    std::vector<std::uint16_t> words;
    for (const std::int32_t number : {0, type, position, speed, rate, rate, 1000, 1}) {
      words.push_back(static_cast<std::uint16_t>(static_cast<std::uint32_t>(number) >> 16U));
      words.push_back(static_cast<std::uint16_t>(number));
    }
    return drive.write(0x0058, words);
  }
  void home() {
    EXPECT_EQ(input(1U << 4U), ModbusException::none);
    input(0);
    wait_for_rest();
  }
  void wait_for_rest() {
    for (int i = 0; i < 20000 && (output() & moving) != 0; ++i) clock.advance(milliseconds(10));
    drive.tick();
  }
  double table() { return lab.axis_position_deg(LabAxis::table, clock.now()); }
};

TEST_F(Drive, IsReadyAtPowerOnButNotHomed) {
  EXPECT_EQ(output(), ready | in_position);
}

TEST_F(Drive, HomesToZeroAndSaysSo) {
  lab.set_axis_position(LabAxis::table, degrees(50));
  AzDrive turned(lab, DriveOptions{}, 1.0);
  std::uint16_t zhome[2] = {0, 1U << 4U};
  ASSERT_EQ(turned.write(0x007C, zhome), ModbusException::none);
  clock.advance(milliseconds(300));
  EXPECT_GT(table(), 1.0);
  EXPECT_LT(table(), 49.0);
  clock.advance(seconds(5));
  std::uint16_t out[2] = {};
  ASSERT_EQ(turned.read(0x007E, out), ModbusException::none);
  EXPECT_NE(out[1] & home_end, 0U);
  EXPECT_NEAR(table(), 0.0, 1e-9);
}

TEST_F(Drive, RefusesAnAbsoluteMoveBeforeHomingWithAnAlarm) {
  EXPECT_EQ(go(1, 1000), ModbusException::none);
  EXPECT_EQ(value(0x0080), 0x4A);
  EXPECT_NE(output() & alarmed, 0U);
  EXPECT_EQ(output() & ready, 0U);
}

TEST_F(Drive, AMoveTakesTheTimeOfItsTrapezoidAndTurnsTheTable) {
  home();
  ASSERT_EQ(go(1, 9000), ModbusException::none);  // 90° at 90°/s and 360°/s²: 1.25 s
  EXPECT_EQ(value(0x0066), 0);                    // the trigger clears itself
  clock.advance(milliseconds(625));
  EXPECT_NE(output() & moving, 0U);
  EXPECT_EQ(output() & (ready | in_position), 0U);
  EXPECT_EQ(value(0x00CC), 4500);
  EXPECT_EQ(value(0x00CA), 9000);
  EXPECT_NEAR(table(), 45.0, 1e-6);
  clock.advance(milliseconds(624));
  EXPECT_NE(output() & moving, 0U);
  clock.advance(milliseconds(2));
  EXPECT_EQ(output() & (moving | ready | in_position | home_end), ready | in_position | home_end);
  EXPECT_EQ(value(0x00CC), 9000);
  EXPECT_NEAR(table(), 90.0, 1e-9);
}

TEST_F(Drive, ASpeedFactorShortensTheSameMotion) {
  AzDrive quick(lab, {.homed = true}, 5.0);
  const std::uint16_t words[16] = {0, 0, 0, 1, 0, 9000, 0, 9000, 0, 36000, 0, 36000, 0, 1000, 0, 1};
  ASSERT_EQ(quick.write(0x0058, words), ModbusException::none);
  clock.advance(milliseconds(125));
  EXPECT_NEAR(table(), 45.0, 1e-6);
  clock.advance(milliseconds(126));
  EXPECT_NEAR(table(), 90.0, 1e-9);
}

TEST_F(Drive, WrapMovesGoTheWayTheyPromise) {
  home();
  go(1, 35000);
  wait_for_rest();
  go(9, 1000);  // the short way: 10° through 360°
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 37000);
  go(11, 2000);  // reverse only
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 2000);
  go(10, 1000);  // forward only
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 37000);
  go(2, -500);
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 36500);
}

TEST_F(Drive, StopBrakesAndHoldsOffUntilReleased) {
  home();
  go(1, 18000);
  clock.advance(milliseconds(500));
  ASSERT_EQ(input(1U << 5U), ModbusException::none);
  clock.advance(milliseconds(249));
  EXPECT_NE(output() & moving, 0U);
  clock.advance(milliseconds(2));
  EXPECT_EQ(output() & (moving | ready), 0U);
  EXPECT_NEAR(table(), 11.25 + 22.5 + 11.25, 1e-6);
  EXPECT_EQ(go(1, 0), ModbusException::device_failure);
  input(0);
  EXPECT_EQ(go(1, 0), ModbusException::none);
}

TEST_F(Drive, APulseOfStopWithAutomaticOffIsEnough) {
  home();
  go(1, 18000);
  clock.advance(milliseconds(500));
  ASSERT_EQ(set(0x0078, 1 << 5), ModbusException::none);
  wait_for_rest();
  EXPECT_NEAR(table(), 45.0, 1e-6);
  EXPECT_NE(output() & ready, 0U);
  EXPECT_EQ(value(0x0078), 0);
}

TEST_F(Drive, JogsWhileTheInputIsOn) {
  ASSERT_EQ(input(1U << 15U), ModbusException::none);
  clock.advance(seconds(1));
  EXPECT_NE(output() & moving, 0U);
  const double before = table();
  EXPECT_LT(before, -10.0);
  input(0);
  wait_for_rest();
  EXPECT_LT(table(), before);
  EXPECT_EQ(output() & moving, 0U);
}

TEST_F(Drive, StopsAndAlarmsWhenNobodyTalksToIt) {
  home();
  ASSERT_EQ(set(0x138A, 500), ModbusException::none);
  drive.note_message();
  go(1, 36000);
  clock.advance(milliseconds(450));
  drive.note_message();
  clock.advance(milliseconds(450));
  drive.tick();
  EXPECT_EQ(drive.alarm(), 0);
  clock.advance(milliseconds(60));
  drive.tick();
  EXPECT_EQ(drive.alarm(), 0x85);
  clock.advance(seconds(1));
  const double stopped = table();
  EXPECT_LT(stopped, 180.0);
  clock.advance(seconds(5));
  EXPECT_EQ(table(), stopped);
}

TEST_F(Drive, AStuckMotorEndsInADeviationAlarmAndDoesNotTurn) {
  home();
  drive.set_faults({.stuck = true});
  go(1, 9000);
  clock.advance(milliseconds(400));
  drive.tick();
  EXPECT_EQ(value(0x0080), 0x10);
  clock.advance(seconds(3));
  EXPECT_EQ(value(0x00CC), 0);
  EXPECT_NEAR(table(), 0.0, 1e-9);
  drive.set_faults({});
  input(1U << 7U);
  input(0);
  EXPECT_EQ(value(0x0080), 0);
  EXPECT_EQ(go(1, 9000), ModbusException::none);
  wait_for_rest();
  EXPECT_NEAR(table(), 90.0, 1e-9);
}

TEST_F(Drive, LostStepsShowInTheFeedbackAndTheNextMoveMakesThemGood) {
  home();
  drive.set_faults({.slip_steps = 250.0});
  go(1, 9000);
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 8750);
  EXPECT_EQ(value(0x00C6), 9000);
  EXPECT_EQ(output() & in_position, 0U);
  EXPECT_NEAR(table(), 87.5, 1e-9);
  go(1, 9000);
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 9000);
  EXPECT_NEAR(table(), 90.0, 1e-9);
}

TEST_F(Drive, BacklashIsInTheTruthOnly) {
  home();
  drive.set_faults({.backlash_deg = 0.5});
  go(1, 9000);
  wait_for_rest();
  EXPECT_EQ(value(0x00CC), 9000);
  EXPECT_NEAR(table(), 89.75, 1e-9);
  go(1, 0);
  wait_for_rest();
  EXPECT_NEAR(table(), 0.25, 1e-9);
}

TEST_F(Drive, LimitsEndAMoveWithAnAlarm) {
  AzDrive arm(lab,
              {.unit = 3,
               .axis = LabAxis::arm_elevation,
               .home_deg = 50.0,
               .lower_deg = 5.0,
               .upper_deg = 85.0,
               .homed = true},
              1.0);
  const std::uint16_t words[16] = {0, 0, 0, 1, 0, 9000, 0, 9000, 0, 36000, 0, 36000, 0, 1000, 0, 1};
  ASSERT_EQ(arm.write(0x0058, words), ModbusException::none);
  clock.advance(seconds(5));
  arm.tick();
  EXPECT_EQ(arm.alarm(), 0x67);
  EXPECT_NEAR(lab.axis_position_deg(LabAxis::arm_elevation, clock.now()), 85.0, 1e-9);
}

TEST_F(Drive, PresetMakesHereZero) {
  lab.set_axis_position(LabAxis::table, degrees(20));
  AzDrive turned(lab, DriveOptions{}, 1.0);
  const std::uint16_t one[2] = {0, 1};
  ASSERT_EQ(turned.write(0x018A, one), ModbusException::none);
  std::uint16_t words[2] = {7, 7};
  ASSERT_EQ(turned.read(0x00CC, words), ModbusException::none);
  EXPECT_EQ(words[0], 0);
  EXPECT_EQ(words[1], 0);
  EXPECT_NEAR(table(), 20.0, 1e-9);
}

TEST_F(Drive, RefusesWhatIsNotThereOrOutOfRangeAndChangesNothing) {
  std::uint16_t word = 0;
  EXPECT_EQ(drive.read(0x0002, {&word, 1}), ModbusException::illegal_address);
  EXPECT_EQ(set(0x007E, 1), ModbusException::illegal_address);     // status can't be written
  EXPECT_EQ(set(0x138A, 99999), ModbusException::device_failure);  // longer than the drive can count
  EXPECT_EQ(value(0x138A), 0);
  EXPECT_EQ(go(1, 100, 9000, 0), ModbusException::device_failure);  // no such rate
  EXPECT_EQ(input(1U << 3U), ModbusException::device_failure);      // stored operations are not served
}

}  // namespace
}  // namespace eigenpose::sim
