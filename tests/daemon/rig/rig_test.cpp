#include "daemon/rig/rig.h"

#include <future>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/daemon/fakes.h"

namespace eigenpose::rig_test {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
const Dof arm{"arm", "deg", -90.0, 90.0, false};

class RigTest : public testing::Test {
 protected:
  RigAxis fake(const Dof& dof, FakeAxisRecord& record) {
    RigAxisOptions options;
    options.dof = dof;
    return {options, [&record, dof, this] { return std::make_unique<FakeAxis>(dof, record, clock_); }};
  }
  std::unique_ptr<Rig> rig(std::vector<RigAxis> axes, std::vector<RigLamp> lamps = {}) {
    return std::make_unique<Rig>(std::move(axes), std::move(lamps), clock_, heartbeat_);
  }

  ManualClock clock_{TimePoint(seconds(100))};
  Heartbeat heartbeat_{clock_};
  FakeAxisRecord table_record_;
  FakeAxisRecord arm_record_;
  FakeLampRecord key_record_;
  FakeLampRecord fill_record_;
};

TEST_F(RigTest, AnAxisThatCannotBeOpenedIsReportedAndDoesNotStopTheOthers) {
  RigAxisOptions broken;
  broken.dof = arm;
  const auto rig =
      this->rig({{broken, []() -> std::unique_ptr<Axis> { throw DeviceLost("arm", "open", "not there"); }},
                 fake(table, table_record_)});
  EXPECT_THROW(rig->run([](Rig::Control& axes) { axes.move_to("arm", 0, {}); }), DeviceLost);
  double reached = 0.0;
  rig->run([&](Rig::Control& axes) { reached = axes.move_to("table", 30, {}); });
  EXPECT_EQ(reached, 30.0);
  const std::vector<AxisStatus> status = rig->status().axes;
  EXPECT_THAT(status[0].error.value_or(""), HasSubstr("arm: open: not there"));
  EXPECT_EQ(status[1].state->position, 30.0);
}

TEST_F(RigTest, EndingItEndsAMotionUnderWay) {
  table_record_.blocks = true;
  auto rig = this->rig({fake(table, table_record_)});
  auto work = std::async(std::launch::async, [&rig = *rig] {
    rig.run([](Rig::Control& axes) { axes.move_to("table", 90, {}); });
  });
  {
    std::unique_lock lock(table_record_.mutex);
    table_record_.changed.wait(lock, [&] { return table_record_.moving; });
  }
  rig.reset();
  EXPECT_THROW(work.get(), Interrupted);
  EXPECT_FALSE(table_record_.moving);
}

TEST_F(RigTest, StopReachesEveryAxisEvenIfOneCannotBeTold) {
  arm_record_.fails_from_stop = 0;
  const auto rig = this->rig({fake(arm, arm_record_), fake(table, table_record_)});
  rig->run([](Rig::Control& axes) {
    axes.state("arm");
    axes.state("table");
  });
  rig->stop_motion();
  EXPECT_EQ(arm_record_.stops, 1);
  EXPECT_EQ(table_record_.stops, 1);
}

TEST_F(RigTest, WorkThatFailsLeavesNoAxisInMotion) {
  const auto rig = this->rig({fake(table, table_record_)});
  EXPECT_THROW(rig->run([](Rig::Control& axes) {
    axes.state("table");
    throw FileError("/sets", "disk full");
  }),
               FileError);
  EXPECT_EQ(table_record_.stops, 1);
}

TEST_F(RigTest, LampsAreLitAtTheStartAtTheirLevels) {
  const auto rig = this->rig({}, {fake_lamp("key", 0.8, key_record_), fake_lamp("fill", 0.3, fill_record_)});
  eventually([&] { return rig->status().lamps[1].level.has_value(); });
  const std::vector<LampStatus> lamps = rig->status().lamps;
  EXPECT_EQ(lamps[0].name, "key");
  EXPECT_EQ(lamps[0].model, "fake");
  EXPECT_EQ(lamps[0].level, 0.8);
  EXPECT_EQ(lamps[0].wanted_level, 0.8);
  EXPECT_EQ(lamps[1].level, 0.3);
  EXPECT_FALSE(lamps[1].error);
}

TEST_F(RigTest, ALampThatCannotBeOpenedStandsInTheStatusAndIsTriedAgain) {
  key_record_.opens = false;
  const auto rig = this->rig({}, {fake_lamp("key", 0.8, key_record_)});
  eventually([&] { return rig->status().lamps[0].error.has_value(); });
  EXPECT_THAT(*rig->status().lamps[0].error, HasSubstr("key: open: not plugged in"));
  EXPECT_FALSE(rig->status().lamps[0].level);
  key_record_.opens = true;
  clock_.advance(seconds(5));
  eventually([&] { return rig->status().lamps[0].level.has_value(); });
  EXPECT_FALSE(rig->status().lamps[0].error);
}

TEST_F(RigTest, ALampThatFailsLaterIsNoticedWithoutAnyWork) {
  const auto rig = this->rig({}, {fake_lamp("key", 0.8, key_record_)});
  eventually([&] { return rig->status().lamps[0].level.has_value(); });
  key_record_.answers = false;
  clock_.advance(seconds(5));
  eventually([&] { return rig->status().lamps[0].error.has_value(); });
  EXPECT_THAT(*rig->status().lamps[0].error, HasSubstr("no answer"));
  EXPECT_FALSE(rig->status().lamps[0].level) << "what is not confirmed is not shown as lit";
}

TEST_F(RigTest, WorkCanAskForLightAndGetsTheLampsErrorIfThereIsNone) {
  key_record_.opens = false;
  const auto rig = this->rig({}, {fake_lamp("fill", 0.3, fill_record_), fake_lamp("key", 0.8, key_record_)});
  EXPECT_THROW(rig->run([](Rig::Control& axes) { axes.light_lamps(); }), DeviceLost);
  key_record_.opens = true;
  // It does not wait for the next time that lamps are looked after.
  EXPECT_NO_THROW(rig->run([](Rig::Control& axes) { axes.light_lamps(); }));
  EXPECT_EQ(key_record_.level, 0.8);
}

TEST_F(RigTest, WorkLearnsWhichLampsMayHaveBeenDarkSinceTheyWereLit) {
  const auto rig = this->rig({}, {fake_lamp("fill", 0.3, fill_record_), fake_lamp("key", 0.8, key_record_)});
  eventually([&] { return rig->status().lamps[1].level.has_value(); });
  const auto light = [&] {
    std::vector<std::string> interrupted;
    rig->run([&](Rig::Control& axes) { interrupted = axes.light_lamps(); });
    return interrupted;
  };
  EXPECT_THAT(light(), ElementsAre());
  ++key_record_.interruptions;
  EXPECT_THAT(light(), ElementsAre("key"));
  EXPECT_THAT(light(), ElementsAre()) << "said once";
  fill_record_.answers = false;
  EXPECT_THROW(light(), DeviceTimeout);
  fill_record_.answers = true;
  EXPECT_THAT(light(), ElementsAre("fill")) << "it was not known to be lit";
}

TEST_F(RigTest, ATargetOutsideItsRangeIsNoFailureOfTheAxis) {
  arm_record_.homed = false;
  const auto rig = this->rig({fake(arm, arm_record_)});
  rig->run([](Rig::Control& axes) { axes.state("arm"); });
  EXPECT_THROW(rig->run([](Rig::Control& axes) { axes.move_to("arm", 90.001, {}); }), std::out_of_range);
  EXPECT_EQ(arm_record_.homings, 0) << "nothing moves for a target that is refused";
  const AxisStatus status = rig->status().axes[0];
  EXPECT_FALSE(status.error);
  EXPECT_FALSE(status.state->moving);
}

TEST_F(RigTest, SaysWhereEveryActuatorStandsAndLeavesOutWhatIsNotKnown) {
  table_record_.position = 42.0;
  arm_record_.homed = false;
  RigAxisOptions broken;
  broken.dof = {"slide", "mm", 0.0, 100.0, false};
  const auto rig =
      this->rig({fake(table, table_record_),
                 fake(arm, arm_record_),
                 {broken, []() -> std::unique_ptr<Axis> { throw DeviceLost("slide", "open", "not there"); }}},
                {fake_lamp("key", 0.8, key_record_)});
  std::vector<ActuatorPosition> actuators;
  rig->run([&](Rig::Control& axes) {
    axes.light_lamps();
    actuators = axes.actuators();
  });
  ASSERT_EQ(actuators.size(), 4U);
  EXPECT_EQ(actuators[0].name, "table");
  EXPECT_EQ(actuators[0].unit, "deg");
  EXPECT_EQ(actuators[0].position, 42.0);
  EXPECT_EQ(actuators[0].tolerance, 0.5);
  EXPECT_DOUBLE_EQ(actuators[0].distance_from(352.0), 50.0) << "through the seam of a turn";
  EXPECT_FALSE(actuators[1].position) << "not homed";
  EXPECT_FALSE(actuators[2].position) << "not there";
  EXPECT_EQ(actuators[3].unit, "level");
  EXPECT_EQ(actuators[3].position, 0.8);
  EXPECT_DOUBLE_EQ(actuators[3].distance_from(0.5), 0.3);
}

TEST_F(RigTest, AMoveThatTakesLongerThanItMayIsOverdue) {
  table_record_.blocks = true;
  const auto rig = this->rig({fake(table, table_record_)});
  auto work = std::async(std::launch::async,
                         [&] { rig->run([](Rig::Control& axes) { axes.move_to("table", 90, {}); }); });
  {
    std::unique_lock lock(table_record_.mutex);
    table_record_.changed.wait(lock, [&] { return table_record_.moving; });
  }
  clock_.advance(seconds(45));  // the move's 30 s, and 15 s to stop
  EXPECT_TRUE(heartbeat_.overdue().empty());
  clock_.advance(seconds(16));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("rig"));
  rig->stop_motion();
  EXPECT_THROW(work.get(), Interrupted);
}

}  // namespace
}  // namespace eigenpose::rig_test
