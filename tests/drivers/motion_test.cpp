// What every axis driver leaves to motion.h, on scripted readings: no drive, no line, no time of its own.

#include "drivers/motion.h"

#include <limits>
#include <new>
#include <system_error>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/axis.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

const TimePoint begin{100s};
const TimePoint far_away = begin + 1h;
const Dof turntable{"table", "deg", 0.0, 360.0, true};
const Dof slide{"slide", "mm", -10.0, 50.0, false};

MotionPatience patience() {
  return {.poll_interval = 10ms, .start_time = 500ms, .settle_time = 300ms, .stall_time = 2s};
}

MotionOrder move_to_30() {
  return {"table", "move to 30 deg", turntable, MotionOrder::Goal::target, 30.0, 0.1, patience()};
}

MotionOrder homing() {
  return {"table", "home", turntable, MotionOrder::Goal::home, 0.0, 0.1, patience()};
}

MotionReading moving_at(double position) {
  return {.moving = true, .in_position = false, .homed = true, .alarm = {}, .position = position};
}

MotionReading standing_at(double position) {
  return {.moving = false, .in_position = true, .homed = true, .alarm = {}, .position = position};
}

template <class Failure = DeviceError, class Work>
std::string failure_of(const Work& work) {
  try {
    work();
  } catch (const Failure& error) {
    return error.what();
  }
  return "no failure";
}

TEST(MotionWatch, AMoveHasArrivedWhenItStandsWithinTheTolerance) {
  for (const double miss : {0.0, 0.099, -0.099}) {
    MotionWatch watch(move_to_30(), begin);
    EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 10ms, far_away));
    EXPECT_FALSE(watch.arrived(moving_at(30.0 + miss), begin + 20ms, far_away)) << "still moving";
    EXPECT_TRUE(watch.arrived(standing_at(30.0 + miss), begin + 30ms, far_away)) << miss;
  }
  for (const double miss : {0.101, -0.101}) {
    MotionWatch watch(move_to_30(), begin);
    EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 10ms, far_away));
    EXPECT_FALSE(watch.arrived(standing_at(30.0 + miss), begin + 20ms, far_away)) << miss;
  }
}

TEST(MotionWatch, AWholeTurnMoreIsAnotherPlace) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(380.0), begin + 10ms, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(390.0), begin + 20ms, far_away)) << "positions count on";
}

TEST(MotionWatch, WaitsForTheDrivesOwnWindow) {
  MotionWatch watch(move_to_30(), begin);
  MotionReading near = standing_at(30.0);
  near.in_position = false;
  EXPECT_FALSE(watch.arrived(near, begin + 10ms, far_away));
  EXPECT_TRUE(watch.arrived(standing_at(30.0), begin + 20ms, far_away));
}

TEST(MotionWatch, AMoveToWhereItStandsHasArrivedAtOnce) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_TRUE(watch.arrived(standing_at(30.0), begin, far_away));
}

TEST(MotionWatch, AMotorThatDoesNotStartIsGivenTheStartTimeAndNoMore) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(standing_at(10.0), begin + 499ms, far_away));
  const std::string text =
      failure_of([&] { (void)watch.arrived(standing_at(10.0), begin + 500ms, far_away); });
  EXPECT_THAT(text, StartsWith("table: move to 30 deg: it did not move and stands at 10.000 deg"));
  EXPECT_THAT(text, HasSubstr("not at 30.000 deg"));
}

TEST(MotionWatch, AMotorThatHasStoppedElsewhereIsGivenTheSettleTimeAndNoMore) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(20.0), begin + 1s, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(29.0), begin + 1100ms, far_away)) << "seen to stand from here on";
  EXPECT_FALSE(watch.arrived(standing_at(29.0), begin + 1399ms, far_away));
  const std::string text =
      failure_of([&] { (void)watch.arrived(standing_at(29.0), begin + 1400ms, far_away); });
  EXPECT_THAT(text, AllOf(HasSubstr("it stopped at 29.000 deg"), HasSubstr("steps were lost")));
}

TEST(MotionWatch, AMotorThatSettlesLateHasArrived) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(31.0), begin + 1s, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(30.5), begin + 1100ms, far_away));
  EXPECT_TRUE(watch.arrived(standing_at(30.05), begin + 1399ms, far_away));
}

TEST(MotionWatch, StandingBetweenTwoMovementsIsCountedAnew) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 100ms, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(12.0), begin + 200ms, far_away));
  EXPECT_FALSE(watch.arrived(moving_at(13.0), begin + 450ms, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(14.0), begin + 600ms, far_away));
  EXPECT_FALSE(watch.arrived(standing_at(14.0), begin + 899ms, far_away));
  EXPECT_NE(failure_of([&] { (void)watch.arrived(standing_at(14.0), begin + 900ms, far_away); }),
            "no failure");
}

TEST(MotionWatch, AMotorThatMovesAndGetsNowhereIsStuckAfterTheStallTime) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 100ms, far_away));
  EXPECT_FALSE(watch.arrived(moving_at(11.0), begin + 1s, far_away));
  EXPECT_FALSE(watch.arrived(moving_at(11.0), begin + 2999ms, far_away));
  EXPECT_THAT(failure_of([&] { (void)watch.arrived(moving_at(11.0), begin + 3s, far_away); }),
              HasSubstr("stuck at 11.000 deg"));
}

/// When a moving motor is called stuck whose position is `position_at` of the time since the beginning, read
/// every 100 ms for a minute at most.
Duration stuck_after(const std::function<double(Duration)>& position_at) {
  MotionWatch watch(move_to_30(), begin);
  for (Duration t = 100ms; t <= 60s; t += 100ms) {
    try {
      EXPECT_FALSE(watch.arrived(moving_at(position_at(t)), begin + t, far_away));
    } catch (const DeviceError& error) {
      EXPECT_THAT(error.what(), HasSubstr("stuck at"));
      return t;
    }
  }
  return Duration::max();
}

TEST(MotionWatch, AMotorThatDithersAboutOnePlaceIsStuck) {
  for (const double counts : {1.0, 2.0}) {
    const double step = 0.05;  // the tolerance is two of them
    int reading = 0;
    const auto dithering = [&](Duration t) {
      if (t < 1s) return 10.0 + std::chrono::duration<double>(t).count();
      return 10.9 + (++reading % 2 == 0 ? counts * step : 0.0);
    };
    EXPECT_LE(stuck_after(dithering), 1s + 200ms + 2s) << counts;
  }
}

TEST(MotionWatch, AMotorThatTurnsBackIsNotStuckBeforeItStandsStill) {
  // Backlash compensation: past the target, and slowly back over the same way; then jammed.
  const auto there_and_back = [](Duration t) {
    const double seconds = std::chrono::duration<double>(t).count();
    if (seconds <= 5.0) return 20.0 + 4.0 * seconds;
    return std::max(32.0, 40.0 - 0.8 * (seconds - 5.0));
  };
  EXPECT_GE(stuck_after(there_and_back), 15s + 2s - 200ms);
  EXPECT_LE(stuck_after(there_and_back), 15s + 2s + 100ms);
}

TEST(MotionWatch, ASlowMotorIsNotStuck) {
  MotionWatch watch(move_to_30(), begin);
  for (int i = 1; i <= 20; ++i)
    EXPECT_FALSE(watch.arrived(moving_at(10.0 + 0.001 * i), begin + i * 1900ms, far_away)) << i;
}

TEST(MotionWatch, AnAlarmDuringTheMotionEndsItEvenAtTheTarget) {
  for (MotionReading reading : {moving_at(20.0), standing_at(30.0)}) {
    MotionWatch watch(move_to_30(), begin);
    EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 10ms, far_away));
    reading.alarm = "overload";
    EXPECT_THAT(failure_of([&] { (void)watch.arrived(reading, begin + 20ms, far_away); }),
                HasSubstr("alarm: overload"));
  }
}

TEST(MotionWatch, TheDeadlineEndsAMotionThatGoesWell) {
  MotionWatch watch(move_to_30(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(10.0), begin + 999ms, begin + 1s));
  EXPECT_THAT(
      failure_of<DeviceTimeout>([&] { (void)watch.arrived(moving_at(11.0), begin + 1s, begin + 1s); }),
      AllOf(HasSubstr("not there by the deadline"), HasSubstr("11.000 deg")));
  MotionWatch in_time(move_to_30(), begin);
  EXPECT_TRUE(in_time.arrived(standing_at(30.0), begin + 1s, begin + 1s)) << "there at the deadline is there";
}

TEST(MotionWatch, HomedIsNotBelievedBeforeTheMotorHasMovedOrHadItsTime) {
  MotionWatch watch(homing(), begin);
  EXPECT_FALSE(watch.arrived(standing_at(0.0), begin + 10ms, far_away)) << "the bit of the last homing";
  EXPECT_FALSE(watch.arrived(standing_at(0.0), begin + 499ms, far_away));
  EXPECT_TRUE(watch.arrived(standing_at(0.0), begin + 500ms, far_away)) << "it homes where it stands";

  MotionWatch moved(homing(), begin);
  EXPECT_FALSE(moved.arrived(moving_at(3.0), begin + 10ms, far_away));
  EXPECT_TRUE(moved.arrived(standing_at(0.0), begin + 20ms, far_away));
}

TEST(MotionWatch, HomingThatEndsWithoutHomeIsAFailure) {
  MotionReading lost = standing_at(0.0);
  lost.homed = false;
  MotionWatch watch(homing(), begin);
  EXPECT_FALSE(watch.arrived(moving_at(3.0), begin + 10ms, far_away));
  EXPECT_FALSE(watch.arrived(lost, begin + 20ms, far_away));
  EXPECT_FALSE(watch.arrived(lost, begin + 319ms, far_away));
  EXPECT_THAT(failure_of([&] { (void)watch.arrived(lost, begin + 320ms, far_away); }),
              HasSubstr("not homed"));
}

/// A drive that reads what it is told to, one reading a poll.
class ScriptedDrive {
 public:
  explicit ScriptedDrive(std::vector<MotionReading> readings) : readings_(std::move(readings)) {}

  MotionSteps steps() {
    return {.start =
                [this] {
                  ++starts;
                  if (start_failure) throw DeviceLost("table", "move", "unplugged");
                },
            .read =
                [this] {
                  clock.advance(10ms);
                  if (on_read) on_read();
                  if (next_ == readings_.size()) throw DeviceTimeout("table", "move", "no answer");
                  return readings_[next_++];
                },
            .finish = [this] { ++finishes; },
            .halt =
                [this] {
                  ++halts;
                  return consequence;
                }};
  }
  MotionReading run(const std::stop_token& stop = {}) {
    return carry_out(move_to_30(), steps(), clock, begin + 1h, stop);
  }

  ManualClock clock{begin};
  std::function<void()> on_read;
  bool start_failure = false;
  std::string consequence = "the drive was told to stop";
  int starts = 0;
  int finishes = 0;
  int halts = 0;

 private:
  std::vector<MotionReading> readings_;
  std::size_t next_ = 0;
};

/// `carry_out` sleeps between polls; this lets its clock run on.
class RunningClock {
 public:
  explicit RunningClock(ManualClock& clock)
      : thread_([&clock](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            clock.advance(1ms);
            std::this_thread::yield();
          }
        }) {}

 private:
  std::jthread thread_;
};

TEST(CarryOut, StartsOnceAndFinishesAtArrivalWithoutAStop) {
  ScriptedDrive drive({moving_at(10.0), moving_at(20.0), standing_at(30.0)});
  const RunningClock time(drive.clock);
  EXPECT_EQ(drive.run().position, 30.0);
  EXPECT_EQ(drive.starts, 1);
  EXPECT_EQ(drive.finishes, 1);
  EXPECT_EQ(drive.halts, 0);
}

TEST(CarryOut, EveryFailureKeepsItsKindAndSaysWhatBecameOfTheMotor) {
  ScriptedDrive unplugged({});
  unplugged.start_failure = true;
  EXPECT_EQ(failure_of<DeviceLost>([&] { (void)unplugged.run(); }),
            "table: move: unplugged; the drive was told to stop");
  ScriptedDrive silent({});
  EXPECT_EQ(failure_of<DeviceTimeout>([&] { (void)silent.run(); }),
            "table: move: no answer; the drive was told to stop");
  MotionReading alarm = moving_at(10.0);
  alarm.alarm = "overload";
  ScriptedDrive alarmed({alarm});
  EXPECT_EQ(failure_of([&] { (void)alarmed.run(); }),
            "table: move to 30 deg: alarm: overload; the drive was told to stop");
  for (const ScriptedDrive* drive : {&unplugged, &silent, &alarmed}) {
    EXPECT_EQ(drive->halts, 1);
    EXPECT_EQ(drive->finishes, 0);
  }
}

TEST(CarryOut, AStopBeforeTheStartSendsNoCommand) {
  ScriptedDrive drive({standing_at(30.0)});
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW((void)drive.run(stop.get_token()), Interrupted);
  EXPECT_EQ(drive.starts, 0);
}

TEST(CarryOut, AStopDuringTheMotionTellsTheDriveToStop) {
  ScriptedDrive drive({moving_at(10.0), moving_at(20.0), standing_at(30.0)});
  const RunningClock time(drive.clock);
  std::stop_source stop;
  drive.on_read = [&] { stop.request_stop(); };
  EXPECT_THROW((void)drive.run(stop.get_token()), Interrupted);
  EXPECT_EQ(drive.halts, 1);
}

TEST(CarryOut, AnInterruptedMotionSaysWhatBecameOfTheMotor) {
  ScriptedDrive drive({moving_at(10.0), moving_at(20.0), standing_at(30.0)});
  drive.consequence = "the drive could NOT be told to stop; use its emergency stop";
  const RunningClock time(drive.clock);
  std::stop_source stop;
  drive.on_read = [&] { stop.request_stop(); };
  EXPECT_EQ(failure_of<Interrupted>([&] { (void)drive.run(stop.get_token()); }),
            "table: move to 30 deg: interrupted on request; the drive could NOT be told to stop; use its "
            "emergency stop");
}

TEST(CarryOut, AFailureThatIsNoDevicesOwnStopsTheMotorTooAndSaysSo) {
  const std::vector<std::function<void()>> failures = {
      [] { throw std::bad_alloc(); },
      [] { throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again)); },
      [] { throw Error("no folder for the claims of devices"); },
      [] { throw FileError("/run/claim", "is not there"); },
  };
  for (const std::function<void()>& fail : failures) {
    ScriptedDrive drive({moving_at(10.0), standing_at(30.0)});
    drive.on_read = fail;
    EXPECT_THAT(failure_of([&] { (void)drive.run(); }),
                AllOf(StartsWith("table: move to 30 deg: " + failure_of<std::exception>(fail)),
                      HasSubstr("; the drive was told to stop")));
    EXPECT_EQ(drive.halts, 1);
    EXPECT_EQ(drive.finishes, 0);
  }
  ScriptedDrive drive({moving_at(10.0)});
  drive.on_read = [] { throw 7; };
  EXPECT_THROW((void)drive.run(), int);
  EXPECT_EQ(drive.halts, 1);
}

TEST(CarryOut, AFailureThatTheStopHasBroughtAboutIsAnInterruption) {
  MotionReading alarm = standing_at(12.0);
  alarm.alarm = "stopped by input";
  ScriptedDrive drive({alarm});
  std::stop_source stop;
  drive.on_read = [&] { stop.request_stop(); };
  EXPECT_THAT(failure_of<Interrupted>([&] { (void)drive.run(stop.get_token()); }),
              AllOf(HasSubstr("interrupted on request"), HasSubstr("told to stop")));
  EXPECT_EQ(drive.halts, 1);
}

TEST(MotionGate, InterruptsTheMotionUnderWayAndNoLaterOne) {
  MotionGate gate;
  gate.interrupt();  // nobody moves: nothing to end
  {
    const MotionGate::Passage motion(gate, {});
    EXPECT_FALSE(motion.token().stop_requested());
    gate.interrupt();
    EXPECT_TRUE(motion.token().stop_requested());
  }
  const MotionGate::Passage next(gate, {});
  EXPECT_FALSE(next.token().stop_requested());
}

TEST(MotionGate, EndsOnTheCallersTokenToo) {
  MotionGate gate;
  std::stop_source caller;
  const MotionGate::Passage motion(gate, caller.get_token());
  EXPECT_FALSE(motion.token().stop_requested());
  caller.request_stop();
  EXPECT_TRUE(motion.token().stop_requested());
}

TEST(NearestTarget, IsTheShortWayOnAPeriodicAxisAndThePositionOnAnother) {
  EXPECT_DOUBLE_EQ(nearest_target(turntable, 10.0, 355.0), 370.0);
  EXPECT_DOUBLE_EQ(nearest_target(turntable, 355.0, 10.0), -5.0);
  EXPECT_DOUBLE_EQ(nearest_target(turntable, 10.0, 725.0), 730.0);
  EXPECT_DOUBLE_EQ(nearest_target(slide, 49.0, -9.0), 49.0);
}

TEST(CheckTarget, TakesBothEndsOfTheRangeAndNothingBeyond) {
  for (const double inside : {-10.0, 0.0, 50.0}) EXPECT_NO_THROW(check_target("slide", slide, inside));
  for (const double outside :
       {-10.001, 50.001, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    EXPECT_THAT(failure_of<std::out_of_range>([&] { check_target("slide", slide, outside); }),
                AllOf(StartsWith("slide: "), HasSubstr("mm is outside -10 … 50")));
}

TEST(CheckJog, IsAsLongAsTheRangeAtMost) {
  for (const double allowed : {60.0, -60.0, 0.0}) EXPECT_NO_THROW(check_jog("slide", slide, allowed));
  for (const double refused : {60.001, -60.001, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(check_jog("slide", slide, refused), std::out_of_range) << refused;
}

TEST(CheckJog, OfAnAxisThatIsNotHomedIsAThirtySixthOfTheRange) {
  EXPECT_DOUBLE_EQ(longest_unhomed_jog(turntable), 10.0);
  for (const double allowed : {10.0, -10.0}) EXPECT_NO_THROW(check_unhomed_jog("table", turntable, allowed));
  for (const double refused : {10.001, -10.001, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THAT(failure_of<std::out_of_range>([&] { check_unhomed_jog("table", turntable, refused); }),
                HasSubstr("10 deg at most in one go"));
}

/// An axis without a jog of its own: what Axis::jog makes of its moves.
class MoveOnlyAxis final : public Axis {
 public:
  explicit MoveOnlyAxis(Dof dof) { info_.dof = std::move(dof); }
  [[nodiscard]] const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint) override { return now; }
  void home(TimePoint, std::stop_token) override {}
  double move_to(double position, TimePoint, std::stop_token) override {
    check_target(info_.dof.name, info_.dof, position);
    return target = position;
  }
  void stop_motion() override {}

  AxisState now;
  double target = -1.0;

 private:
  AxisInfo info_;
};

TEST(AxisJog, IsAMoveByTheDistanceFromWhereTheAxisStands) {
  MoveOnlyAxis axis(turntable);
  axis.now = {.position = 350.0, .moving = false, .homed = true, .alarm = {}};
  EXPECT_DOUBLE_EQ(axis.jog(20.0, far_away, {}), 10.0) << "across the seam";
  MoveOnlyAxis linear(slide);
  linear.now = {.position = 45.0, .moving = false, .homed = true, .alarm = {}};
  EXPECT_DOUBLE_EQ(linear.jog(-20.0, far_away, {}), 25.0);
  EXPECT_THROW(linear.jog(5.5, far_away, {}), std::out_of_range) << "beyond the end";
  EXPECT_DOUBLE_EQ(linear.target, 25.0);
  EXPECT_THROW(linear.jog(61.0, far_away, {}), std::out_of_range) << "longer than the range";
  linear.now.homed = false;
  EXPECT_THAT(failure_of([&] { linear.jog(1.0, far_away, {}); }), HasSubstr("not homed"));
}

TEST(AxisJog, ByPositionsAloneRefusesWhatTheShortWayWouldTurnTheOtherWay) {
  for (const double refused : {180.0, -180.0, 0.7 * 360.0, -0.7 * 360.0, 360.0, -360.0}) {
    MoveOnlyAxis axis(turntable);
    axis.now = {.position = 10.0, .moving = false, .homed = true, .alarm = {}};
    EXPECT_THAT(failure_of<std::out_of_range>([&] { axis.jog(refused, far_away, {}); }),
                HasSubstr("less than 180 deg at a time"))
        << refused;
    EXPECT_EQ(axis.target, -1.0) << "nothing was moved";
  }
  MoveOnlyAxis axis(turntable);
  axis.now = {.position = 10.0, .moving = false, .homed = true, .alarm = {}};
  EXPECT_DOUBLE_EQ(axis.jog(179.0, far_away, {}), 189.0);
  EXPECT_DOUBLE_EQ(axis.jog(-179.0, far_away, {}), 191.0);
  MoveOnlyAxis linear(slide);
  linear.now = {.position = -5.0, .moving = false, .homed = true, .alarm = {}};
  EXPECT_DOUBLE_EQ(linear.jog(50.0, far_away, {}), 45.0) << "more than half of a range that does not close";
}

}  // namespace
}  // namespace eigenpose
