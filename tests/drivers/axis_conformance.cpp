#include "tests/drivers/axis_conformance.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>

#include "core/base/error.h"

namespace eigenpose {

using namespace std::chrono_literals;

// The suite is instantiated by each driver's test program, and by none here.
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(AxisConformance);

namespace {

/// Runs a blocking call on a thread of its own and keeps what it ends with.
class Background {
 public:
  explicit Background(std::function<void(std::stop_token)> work)
      : thread_([this, work = std::move(work)](const std::stop_token& stop) {
          try {
            work(stop);
          } catch (...) {
            failure_ = std::current_exception();
          }
          done_ = true;
        }) {}
  [[nodiscard]] bool done() const { return done_; }
  void request_stop() { thread_.request_stop(); }
  /// Waits for the end; throws what the call threw.
  void finish() {
    if (thread_.joinable()) thread_.join();
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::exception_ptr failure_;
  std::atomic<bool> done_{false};
  std::jthread thread_;
};

}  // namespace

bool AxisConformance::eventually(const std::function<bool()>& condition) {
  const TimePoint patience = soon();
  while (std::chrono::steady_clock::now() < patience) {
    if (condition()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

void AxisConformance::home() {
  axis().home(soon(), {});
  ASSERT_TRUE(axis().state(soon()).homed);
}

TEST_P(AxisConformance, DescribesItself) {
  const AxisInfo& info = axis().info();
  EXPECT_FALSE(info.model.empty());
  EXPECT_LT(info.dof.lower, info.dof.upper);
  EXPECT_GT(info.resolution, 0.0);
  EXPECT_GE(info.arrival_tolerance, info.resolution);
}

TEST_P(AxisConformance, SaysThatItIsNotHomedAndRefusesToMove) {
  EXPECT_FALSE(axis().state(soon()).homed);
  const double before = rig().true_position();
  EXPECT_THROW(axis().move_to(at(0.3), soon(), {}), DeviceError);
  EXPECT_FALSE(rig().truly_moving());
  EXPECT_EQ(rig().true_position(), before);
}

TEST_P(AxisConformance, IsHomedAndAtRestAfterHoming) {
  axis().home(soon(), {});
  const AxisState state = axis().state(soon());
  EXPECT_TRUE(state.homed);
  EXPECT_FALSE(state.moving);
  EXPECT_FALSE(state.alarm.has_value());
  EXPECT_LE(std::abs(difference(state.position, rig().true_position())), tolerance());
}

TEST_P(AxisConformance, ReturnsFromAMoveOnlyWhenItIsThere) {
  home();
  for (const double share : {0.3, 0.55}) {
    const double target = at(share);
    const double reported = axis().move_to(target, soon(), {});
    EXPECT_LE(std::abs(difference(rig().true_position(), target)), tolerance()) << "target " << target;
    EXPECT_LE(std::abs(difference(reported, rig().true_position())), tolerance()) << "target " << target;
    EXPECT_LE(std::abs(difference(axis().state(soon()).position, target)), tolerance());
    EXPECT_FALSE(axis().state(soon()).moving);
  }
}

TEST_P(AxisConformance, ReportsPositionsInsideItsRange) {
  home();
  const Dof& dof = axis().info().dof;
  for (const double share : {0.0, 0.02, 0.98}) {
    const double reported = axis().move_to(at(share), soon(), {});
    if (dof.periodic) {
      EXPECT_GE(reported, dof.lower);
      EXPECT_LT(reported, dof.upper);
    } else {
      EXPECT_GE(reported, dof.lower - tolerance());
      EXPECT_LE(reported, dof.upper + tolerance());
    }
  }
}

TEST_P(AxisConformance, RefusesTargetsOutsideItsRangeBeforeAnythingMoves) {
  home();
  const Dof dof = axis().info().dof;
  const double before = rig().true_position();
  for (const double target : {dof.lower - 1.0, dof.upper + 1.0, std::numeric_limits<double>::quiet_NaN(),
                              std::numeric_limits<double>::infinity(), 1e12}) {
    EXPECT_THROW(axis().move_to(target, soon(), {}), std::out_of_range) << target;
    EXPECT_FALSE(rig().truly_moving());
  }
  EXPECT_EQ(rig().true_position(), before);
}

TEST_P(AxisConformance, MovesNowhereWhenItIsThereAlready) {
  home();
  axis().move_to(at(0.2), soon(), {});
  const double before = rig().true_position();
  axis().move_to(at(0.2), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), before)), tolerance());
}

TEST_P(AxisConformance, JogsByADistanceFromWhereItStands) {
  home();
  axis().move_to(at(0.3), soon(), {});
  const double range = axis().info().dof.upper - axis().info().dof.lower;
  for (const double distance : {0.02 * range, -0.01 * range}) {
    // A line that spoils requests may spoil a jog, which is sent once only: a failure, and never twice the
    // distance.
    bool done = false;
    for (int attempt = 0; attempt < 10 && !done; ++attempt) {
      const double before = rig().true_position();
      try {
        const double reported = axis().jog(distance, soon(), {});
        EXPECT_LE(std::abs(difference(rig().true_position(), before) - distance), tolerance());
        EXPECT_LE(std::abs(difference(reported, rig().true_position())), tolerance());
        done = true;
      } catch (const DeviceError&) {
        EXPECT_LE(std::abs(difference(rig().true_position(), before)), std::abs(distance) + tolerance());
      }
    }
    EXPECT_TRUE(done) << "distance " << distance;
  }
}

TEST_P(AxisConformance, JogsInTheDirectionOfTheDistanceByMoreThanHalfATurnToo) {
  const Dof dof = axis().info().dof;
  if (!dof.periodic) GTEST_SKIP() << "this axis does not close on itself";
  home();
  for (const double distance : {0.7 * dof.period(), -0.7 * dof.period()}) {
    bool done = false;
    for (int attempt = 0; attempt < 10 && !done; ++attempt) {
      const double before = rig().true_position();
      double astray = 0.0;  // how far it was seen outside the way to go
      Background jog([&](const std::stop_token& stop) { axis().jog(distance, soon(), stop); });
      while (!jog.done()) {
        // From where it began, in the direction of the distance: 0 … a whole turn.
        const double way =
            std::fmod(std::copysign(1.0, distance) * (rig().true_position() - before) + 2.0 * dof.period(),
                      dof.period());
        astray = std::max(astray, std::min(way - std::abs(distance), dof.period() - way));
      }
      EXPECT_LE(astray, tolerance()) << "distance " << distance;
      try {
        jog.finish();
        EXPECT_LE(std::abs(difference(rig().true_position(), before + distance)), tolerance());
        done = true;
      } catch (const DeviceError&) {
        // What a faulty line may do to it; the next attempt begins where it was stopped.
      }
    }
    EXPECT_TRUE(done) << "distance " << distance;
  }
}

TEST_P(AxisConformance, RefusesToJogBeyondItsRange) {
  home();
  const Dof dof = axis().info().dof;
  const double before = rig().true_position();
  std::vector<double> distances = {1.01 * (dof.upper - dof.lower), std::numeric_limits<double>::quiet_NaN(),
                                   -std::numeric_limits<double>::infinity()};
  if (!dof.periodic) distances.push_back(dof.lower - axis().state(soon()).position - 1.0);
  for (const double distance : distances) {
    EXPECT_THROW(axis().jog(distance, soon(), {}), std::out_of_range) << distance;
    EXPECT_FALSE(rig().truly_moving());
  }
  EXPECT_EQ(rig().true_position(), before);
}

TEST_P(AxisConformance, GoesTheShortWayRound) {
  if (!axis().info().dof.periodic) GTEST_SKIP() << "this axis does not close on itself";
  home();
  axis().move_to(at(0.03), soon(), {});
  double farthest = 0.0;
  Background move([&](const std::stop_token& stop) { axis().move_to(at(0.97), soon(), stop); });
  while (!move.done())
    farthest = std::max(farthest, std::abs(difference(rig().true_position(), axis().info().dof.lower)));
  move.finish();
  EXPECT_LE(farthest, 0.03 * axis().info().dof.period() + tolerance());
}

TEST_P(AxisConformance, ComesBackToTheSamePlaceAfterMoreThanATurn) {
  if (!axis().info().dof.periodic) GTEST_SKIP() << "this axis does not close on itself";
  home();
  for (const double share : {0.4, 0.8, 0.2, 0.6}) axis().move_to(at(share), soon(), {});
  axis().move_to(at(0.0), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.0))), tolerance());
}

TEST_P(AxisConformance, DoesNotBeginWhenTheStopIsRequestedAlready) {
  home();
  const double before = rig().true_position();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(axis().move_to(at(0.4), soon(), stop.get_token()), Interrupted);
  EXPECT_THROW(axis().home(soon(), stop.get_token()), Interrupted);
  EXPECT_LE(std::abs(difference(rig().true_position(), before)), tolerance());
}

TEST_P(AxisConformance, StopsInTheMiddleOfAMoveOnRequest) {
  home();
  rig().slow_down(true);
  const double target = at(0.45);
  Background move([&](const std::stop_token& stop) { axis().move_to(target, soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  move.request_stop();
  EXPECT_THROW(move.finish(), Interrupted);
  EXPECT_TRUE(eventually([&] { return !rig().truly_moving(); }));
  EXPECT_GT(std::abs(difference(rig().true_position(), target)), tolerance());
}

TEST_P(AxisConformance, IsStoppedByAnotherThread) {
  home();
  rig().slow_down(true);
  const double target = at(0.45);
  Background move([&](const std::stop_token& stop) { axis().move_to(target, soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  axis().stop_motion();
  EXPECT_THROW(move.finish(), Interrupted);
  EXPECT_TRUE(eventually([&] { return !rig().truly_moving(); }));
  EXPECT_GT(std::abs(difference(rig().true_position(), target)), tolerance());
}

TEST_P(AxisConformance, MovesAgainAfterItWasStopped) {
  home();
  axis().stop_motion();
  axis().stop_motion();
  axis().move_to(at(0.2), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.2))), tolerance());
}

TEST_P(AxisConformance, StopsWhenTheDeadlineComesBeforeTheEnd) {
  home();
  rig().slow_down(true);
  const double target = at(0.49);
  EXPECT_THROW(axis().move_to(target, std::chrono::steady_clock::now() + 100ms, {}), DeviceTimeout);
  EXPECT_TRUE(eventually([&] { return !rig().truly_moving(); }));
  EXPECT_GT(std::abs(difference(rig().true_position(), target)), tolerance());
}

TEST_P(AxisConformance, DoesNothingAfterTheDeadline) {
  home();
  const double before = rig().true_position();
  const TimePoint past = std::chrono::steady_clock::now() - 1s;
  EXPECT_THROW(axis().move_to(at(0.3), past, {}), DeviceTimeout);
  EXPECT_THROW(axis().state(past), DeviceTimeout);
  EXPECT_LE(std::abs(difference(rig().true_position(), before)), tolerance());
}

TEST_P(AxisConformance, NamesADeviceThatDoesNotAnswerAndGoesOnWhenItDoes) {
  home();
  rig().silence(true);
  try {
    axis().state(soon());
    FAIL() << "a silent device has answered";
  } catch (const DeviceError& error) {
    EXPECT_FALSE(error.device().empty());
    EXPECT_FALSE(error.operation().empty());
  }
  rig().silence(false);
  EXPECT_TRUE(axis().state(soon()).homed);
}

TEST_P(AxisConformance, FindsADeviceAgainThatWasAway) {
  home();
  rig().unplug();
  EXPECT_THROW(axis().state(soon()), DeviceError);
  EXPECT_THROW(axis().move_to(at(0.3), soon(), {}), DeviceError);
  EXPECT_THROW(axis().home(soon(), {}), DeviceError);
  EXPECT_THROW(axis().stop_motion(), DeviceError);
  rig().plug_in();
  EXPECT_NO_THROW(axis().state(soon()));
  home();
  axis().move_to(at(0.3), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.3))), tolerance());
}

TEST_P(AxisConformance, FailsWhenTheDeviceGoesAwayInTheMiddleOfAMove) {
  home();
  rig().slow_down(true);
  Background move([&](const std::stop_token& stop) { axis().move_to(at(0.45), soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  rig().unplug();
  EXPECT_THROW(move.finish(), DeviceError);
  rig().plug_in();
  rig().slow_down(false);
  home();
  axis().move_to(at(0.2), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.2))), tolerance());
}

TEST_P(AxisConformance, FailsWhenTheDeviceGoesAwayWhileHoming) {
  home();
  axis().move_to(at(0.45), soon(), {});
  rig().slow_down(true);
  Background homing([&](const std::stop_token& stop) { axis().home(soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  rig().unplug();
  EXPECT_THROW(homing.finish(), DeviceError);
  rig().plug_in();
  rig().slow_down(false);
  home();
}

TEST_P(AxisConformance, FailsWhenTheDeviceFallsSilentInTheMiddleOfAMove) {
  home();
  rig().slow_down(true);
  Background move([&](const std::stop_token& stop) { axis().move_to(at(0.45), soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  rig().silence(true);
  EXPECT_THROW(move.finish(), DeviceError);
  rig().silence(false);
  rig().slow_down(false);
  home();
  axis().move_to(at(0.2), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.2))), tolerance());
}

TEST_P(AxisConformance, DoesNotCallAJammedMotorArrived) {
  home();
  rig().jam(true);
  EXPECT_THROW(axis().move_to(at(0.3), soon(), {}), DeviceError);
  rig().jam(false);
  home();
  axis().move_to(at(0.3), soon(), {});
  EXPECT_LE(std::abs(difference(rig().true_position(), at(0.3))), tolerance());
}

TEST_P(AxisConformance, NoticesThatStepsWereLost) {
  home();
  rig().slip();
  const double target = at(0.3);
  EXPECT_THROW(axis().move_to(target, soon(), {}), DeviceError);
  const double reported = axis().state(soon()).position;
  EXPECT_LE(std::abs(difference(reported, rig().true_position())), tolerance());
  EXPECT_GT(std::abs(difference(reported, target)), tolerance());
}

TEST_P(AxisConformance, SaysAnAlarmInWordsAndDoesNotMoveUntilHomed) {
  home();
  rig().raise_alarm();
  const AxisState state = axis().state(soon());
  ASSERT_TRUE(state.alarm.has_value());
  EXPECT_GT(state.alarm->size(), 5U);
  const double before = rig().true_position();
  EXPECT_THROW(axis().move_to(at(0.3), soon(), {}), DeviceError);
  EXPECT_LE(std::abs(difference(rig().true_position(), before)), tolerance());
  home();
  EXPECT_FALSE(axis().state(soon()).alarm.has_value());
  axis().move_to(at(0.3), soon(), {});
}

TEST_P(AxisConformance, StopsAMotorThatRunsOnWhenItIsDestroyed) {
  home();
  rig().slow_down(true);
  Background move([&](const std::stop_token& stop) { axis().move_to(at(0.49), soon(), stop); });
  ASSERT_TRUE(eventually([&] { return rig().truly_moving(); }));
  rig().silence(true);
  EXPECT_THROW(move.finish(), DeviceError);  // and nobody could tell the motor
  rig().silence(false);
  rig().discard_axis();
  EXPECT_TRUE(eventually([&] { return !rig().truly_moving(); }));
}

}  // namespace eigenpose
