#include "sim/lab/trajectory.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace eigenpose::sim {
namespace {

using std::chrono::duration;
using std::chrono::milliseconds;

constexpr TimePoint begin{std::chrono::seconds(100)};

double in_seconds(Duration time) {
  return duration<double>(time).count();
}

TEST(Trajectory, StandsBeforeItsStartAndAfterItsEnd) {
  const auto motion = Trajectory::standstill(10.0, begin).move_to(100.0, {90.0, 360.0, 360.0}, begin);
  EXPECT_EQ(motion.position(begin - milliseconds(5)), 10.0);
  EXPECT_EQ(motion.position(motion.end()), 100.0);
  EXPECT_EQ(motion.position(motion.end() + std::chrono::hours(1)), 100.0);
  EXPECT_EQ(motion.velocity(motion.end()), 0.0);
}

TEST(Trajectory, TakesTheTimeOfATrapezoid) {
  // 90 units at 90/s with 360/s²: a quarter second to speed up, 11.25 units each way, 67.5 at full speed.
  const auto motion = Trajectory::standstill(0.0, begin).move_to(90.0, {90.0, 360.0, 360.0}, begin);
  EXPECT_NEAR(in_seconds(motion.end() - begin), 0.25 + 0.75 + 0.25, 1e-6);
  EXPECT_NEAR(motion.position(begin + milliseconds(250)), 11.25, 1e-6);
  EXPECT_NEAR(motion.velocity(begin + milliseconds(500)), 90.0, 1e-9);
}

TEST(Trajectory, TakesTheTimeOfATriangleWhenTooShortForFullSpeed) {
  const auto motion = Trajectory::standstill(0.0, begin).move_to(-10.0, {90.0, 360.0, 180.0}, begin);
  // v² = 2·10·360·180/(360+180), time = v/360 + v/180.
  const double peak = std::sqrt(2.0 * 10.0 * 360.0 * 180.0 / 540.0);
  EXPECT_NEAR(in_seconds(motion.end() - begin), peak / 360.0 + peak / 180.0, 1e-6);
}

/// Whatever is asked in the middle of whatever motion: position and speed have no jumps, speed and
/// acceleration keep to the limits, and the end is where it should be.
TEST(Trajectory, NeverJumpsWhenItIsCommandedAnewOnTheWay) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> place(-200.0, 200.0);
  std::uniform_real_distribution<double> rate(20.0, 500.0);
  std::uniform_int_distribution<int> wait(0, 900);
  for (int round = 0; round < 200; ++round) {
    TimePoint now = begin;
    auto motion = Trajectory::standstill(place(generator), now);
    double fastest = 0.0;
    double hardest = 0.0;
    for (int command = 0; command < 4; ++command) {
      const MotionLimits limits{rate(generator), rate(generator), rate(generator)};
      fastest = std::max(fastest, limits.speed);
      hardest = std::max({hardest, limits.acceleration, limits.deceleration});
      const double target = place(generator);
      const double before = motion.position(now);
      const double speed_before = motion.velocity(now);
      motion = command == 2 ? motion.stop(limits.deceleration, now) : motion.move_to(target, limits, now);
      EXPECT_NEAR(motion.position(now), before, 1e-9);
      EXPECT_NEAR(motion.velocity(now), speed_before, 1e-9);
      if (command != 2) {
        EXPECT_NEAR(motion.position(motion.end()), target, 1e-9);
      }
      constexpr double dt = 1e-3;
      double position = before;
      double speed = speed_before;
      const TimePoint until = now + milliseconds(wait(generator));
      for (; now < until; now += milliseconds(1)) {
        const double next = motion.position(now + milliseconds(1));
        const double next_speed = motion.velocity(now + milliseconds(1));
        ASSERT_LE(std::abs(next - position), fastest * dt + 1e-6);
        ASSERT_LE(std::abs(next_speed - speed), hardest * dt + 1e-6);
        position = next;
        speed = next_speed;
      }
      now = until;
    }
  }
}

TEST(Trajectory, RunsOnUntilItIsStopped) {
  const auto running = Trajectory::standstill(0.0, begin).run(-1, {50.0, 100.0, 100.0}, begin);
  EXPECT_TRUE(running.moving(begin + std::chrono::hours(5)));
  const TimePoint later = begin + std::chrono::seconds(3);
  EXPECT_NEAR(running.velocity(later), -50.0, 1e-9);
  const auto stopped = running.stop(100.0, later);
  EXPECT_NEAR(in_seconds(stopped.end() - later), 0.5, 1e-9);
  EXPECT_NEAR(stopped.position(stopped.end()), running.position(later) - 12.5, 1e-6);
}

TEST(Trajectory, SpeedsUpAtItsAccelerationAndSlowsDownAtItsDeceleration) {
  const TimePoint later = begin + std::chrono::seconds(10);
  for (const int direction : {1, -1}) {
    const auto running = Trajectory::standstill(0.0, begin).run(direction, {50.0, 100.0, 20.0}, begin);
    EXPECT_NEAR(running.velocity(begin + milliseconds(250)), direction * 25.0, 1e-9);
    const auto faster = running.run(direction, {90.0, 100.0, 20.0}, later);
    EXPECT_NEAR(faster.velocity(later + milliseconds(200)), direction * 70.0, 1e-9);
    const auto slower = running.run(direction, {10.0, 100.0, 20.0}, later);
    EXPECT_NEAR(slower.velocity(later + milliseconds(500)), direction * 40.0, 1e-9);
    EXPECT_NEAR(slower.velocity(later + std::chrono::seconds(3)), direction * 10.0, 1e-9);
    const auto stopped = running.stop(20.0, later);
    EXPECT_NEAR(stopped.velocity(later + milliseconds(500)), direction * 40.0, 1e-9);
  }
}

}  // namespace
}  // namespace eigenpose::sim
