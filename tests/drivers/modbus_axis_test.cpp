// The Modbus axis on simulated drives: the conformance suite over TCP and RTU, with and without a line that
// damages one request in twenty, and what is Modbus's own.

#include "drivers/modbus/modbus_axis.h"

#include <array>
#include <cmath>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/modbus_profile.h"
#include "core/base/error.h"
#include "tests/drivers/modbus_rig.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using sim::WireFault;
using sim::WireFaultKind;
using testing::HasSubstr;

constexpr double one_in_twenty = 0.05;

AxisRigCase rig_case(const std::string& name, ModbusLine line, double fault_rate) {
  return {name, [=] { return std::make_unique<ModbusRig>(line, fault_rate); }};
}

INSTANTIATE_TEST_SUITE_P(Modbus, AxisConformance,
                         testing::Values(rig_case("Tcp", ModbusLine::tcp, 0.0),
                                         rig_case("Rtu", ModbusLine::rtu, 0.0),
                                         rig_case("TcpWithFaults", ModbusLine::tcp, one_in_twenty),
                                         rig_case("RtuWithFaults", ModbusLine::rtu, one_in_twenty)),
                         rig_name);

TimePoint soon() {
  return std::chrono::steady_clock::now() + 20s;
}

std::string failure_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no failure";
}

class ModbusAxisTest : public testing::Test {
 protected:
  /// Patient with a busy machine: these tests count what was asked for and when.
  ModbusRig rig_{ModbusLine::tcp, 0.0, 300ms};
};

TEST_F(ModbusAxisTest, ADamagedAnswerIsAskedForAgain) {
  for (const WireFaultKind kind :
       {WireFaultKind::silence, WireFaultKind::loss, WireFaultKind::partial, WireFaultKind::wrong_unit,
        WireFaultKind::wrong_transaction, WireFaultKind::close_connection}) {
    const auto before = rig_.bus()->statistics();
    rig_.faults().add({kind});
    EXPECT_NO_THROW(rig_.axis().state(soon())) << static_cast<int>(kind);
    const auto after = rig_.bus()->statistics();
    EXPECT_EQ(after.failures, before.failures + 1) << static_cast<int>(kind);
    EXPECT_EQ(after.connections, std::max<std::uint64_t>(before.connections, 1) + 1) << "a new connection";
  }
}

TEST_F(ModbusAxisTest, GivesUpAfterTheAttemptsItHasAndSaysWhy) {
  rig_.faults().add({WireFaultKind::wrong_unit}, 4);
  const std::string text = failure_of([&] { rig_.axis().state(soon()); });
  EXPECT_THAT(text, HasSubstr("table: read state: answer from another unit"));
  EXPECT_THAT(text, HasSubstr("tried 4 times"));
  EXPECT_THAT(text, HasSubstr("127.0.0.1"));
}

TEST_F(ModbusAxisTest, ARefusalIsNotAskedForAgain) {
  rig_.faults().add({WireFaultKind::exception, {}, 2});
  const std::string text = failure_of([&] { rig_.axis().state(soon()); });
  EXPECT_THAT(text, HasSubstr("illegal address"));
  EXPECT_EQ(rig_.bus()->statistics().failures, 1U);
  EXPECT_NO_THROW(rig_.axis().state(soon()));
  EXPECT_EQ(rig_.bus()->statistics().connections, 1U) << "a refusal is an answer: the connection stays";
}

TEST_F(ModbusAxisTest, AnAbsentServerIsNamedWithWhatToDo) {
  rig_.unplug();
  EXPECT_THROW(rig_.axis().state(soon()), DeviceLost);
  EXPECT_THAT(failure_of([&] { rig_.axis().state(soon()); }), HasSubstr("nothing listens there"));
}

TEST_F(ModbusAxisTest, AUnitThatNobodyHasIsNamed) {
  ModbusAxisOptions options = rig_.options();
  options.unit = 99;
  SteadyClock clock;
  ModbusAxis axis(oriental_motor_az_profile(), options, rig_.bus(), clock);
  EXPECT_THAT(failure_of([&] { axis.state(soon()); }), HasSubstr("unit number"));
}

TEST_F(ModbusAxisTest, SaysTheAlarmThatTheDriveRaised) {
  rig_.axis().home(soon(), {});
  rig_.drive().raise_alarm(0x66);
  EXPECT_THAT(*rig_.axis().state(soon()).alarm, HasSubstr("limit switch reached"));
  EXPECT_THAT(failure_of([&] { rig_.axis().move_to(30.0, soon(), {}); }), HasSubstr("limit switch reached"));
}

TEST_F(ModbusAxisTest, AnAlarmDuringAMotionEndsItInWords) {
  rig_.axis().home(soon(), {});
  rig_.slow_down(true);
  std::string text;
  std::jthread mover([&] { text = failure_of([&] { rig_.axis().move_to(170.0, soon(), {}); }); });
  while (!rig_.truly_moving()) std::this_thread::yield();
  rig_.drive().raise_alarm(0x30);
  mover.join();
  EXPECT_THAT(text, testing::AllOf(HasSubstr("alarm: overload"), HasSubstr("told to stop")));
}

TEST_F(ModbusAxisTest, HomingThatEndsElsewhereThanHomeIsAFailure) {
  SteadyClock clock;
  ModbusProfile profile = oriental_motor_az_profile();
  for (const int off : {100, -100, 6}) {
    profile.home_steps = off;
    ModbusAxis axis(profile, rig_.options(), rig_.bus(), clock);
    EXPECT_THAT(failure_of([&] { axis.home(soon(), {}); }),
                HasSubstr("homing ended at 0 steps instead of " + std::to_string(off)));
  }
  profile.home_steps = 4;  // within the tolerance of 0.05 deg
  ModbusAxis axis(profile, rig_.options(), rig_.bus(), clock);
  EXPECT_NO_THROW(axis.home(soon(), {}));
}

TEST_F(ModbusAxisTest, ADriveWithoutAHomedBitIsHomedOnlyByItsOwnDriver) {
  SteadyClock clock;
  ModbusProfile profile = oriental_motor_az_profile();
  profile.homed.reset();
  ModbusAxis axis(profile, rig_.options(), rig_.bus(), clock);
  EXPECT_FALSE(axis.state(soon()).homed);
  EXPECT_THAT(failure_of([&] { axis.move_to(30.0, soon(), {}); }), HasSubstr("not homed"));
  axis.home(soon(), {});
  EXPECT_TRUE(axis.state(soon()).homed);
  EXPECT_NEAR(axis.move_to(30.0, soon(), {}), 30.0, 0.05);
  profile.home_steps = 100;
  ModbusAxis elsewhere(profile, rig_.options(), rig_.bus(), clock);
  EXPECT_THROW(elsewhere.home(soon(), {}), DeviceError);
  EXPECT_FALSE(elsewhere.state(soon()).homed) << "it ended elsewhere";
}

TEST_F(ModbusAxisTest, ADriveWithoutAHomedBitIsNotHomedAfterItsConnectionWasLost) {
  SteadyClock clock;
  ModbusProfile profile = oriental_motor_az_profile();
  profile.homed.reset();
  ModbusAxis axis(profile, rig_.options(), rig_.bus(), clock);
  axis.home(soon(), {});
  rig_.unplug();
  EXPECT_THROW(axis.state(soon()), DeviceError);
  rig_.plug_in();
  // It may have been switched off meanwhile, and counts from anywhere.
  EXPECT_THAT(failure_of([&] { axis.move_to(30.0, soon(), {}); }), HasSubstr("not homed"));
  EXPECT_NEAR(rig_.true_position(), 0.0, 0.05) << "nothing has moved";
  EXPECT_FALSE(axis.state(soon()).homed);
  axis.home(soon(), {});
  EXPECT_TRUE(axis.state(soon()).homed);
  EXPECT_NEAR(axis.move_to(30.0, soon(), {}), 30.0, 0.05);
}

TEST_F(ModbusAxisTest, ALinearAxisKeepsItsEndsAndTakesNoShortCut) {
  SteadyClock clock;
  ModbusAxisOptions options = rig_.options();
  options.dof = {"slide", "mm", -20.0, 340.0, false};
  ModbusAxis axis(oriental_motor_az_profile(), options, rig_.bus(), clock);
  axis.home(soon(), {});
  EXPECT_NEAR(axis.move_to(340.0, soon(), {}), 340.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 340.0, 0.05);
  EXPECT_THROW(axis.jog(0.5, soon(), {}), std::out_of_range);
  EXPECT_NEAR(axis.jog(-30.0, soon(), {}), 310.0, 0.05);
  EXPECT_NEAR(axis.jog(30.0, soon(), {}), 340.0, 0.06) << "up to the end";
  EXPECT_NEAR(axis.move_to(-20.0, soon(), {}), -20.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), -20.0, 0.05) << "all the way back";
}

TEST_F(ModbusAxisTest, AReversedAxisIsJoggedAndReadTheOtherWay) {
  SteadyClock clock;
  ModbusAxisOptions options = rig_.options();
  options.reversed = true;
  ModbusAxis axis(oriental_motor_az_profile(), options, rig_.bus(), clock);
  axis.home(soon(), {});
  EXPECT_NEAR(axis.jog(15.0, soon(), {}), 15.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), -15.0, 0.05);
  EXPECT_NEAR(axis.state(soon()).position, 15.0, 0.05);
}

TEST_F(ModbusAxisTest, ADriveThatOnlyKnowsPositionsJogsInTheDirectionOfTheDistance) {
  SteadyClock clock;
  ModbusProfile profile = oriental_motor_az_profile();
  profile.jog.clear();
  ModbusAxis axis(profile, rig_.options(), rig_.bus(), clock);
  EXPECT_THAT(failure_of([&] { axis.jog(1.0, soon(), {}); }), HasSubstr("not homed"));
  axis.home(soon(), {});
  EXPECT_NEAR(axis.jog(252.0, soon(), {}), 252.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 252.0, 0.05);
  EXPECT_NEAR(axis.jog(360.0, soon(), {}), 252.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 612.0, 0.05);
  EXPECT_NEAR(axis.jog(-270.0, soon(), {}), 342.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 342.0, 0.05);
}

/// The AZ profile as of a drive that counts in 16 bits.
ModbusProfile profile_that_counts_in_16_bits() {
  ModbusProfile profile = oriental_motor_az_profile();
  profile.position.address += 1;  // the lower word
  profile.position.bits = 16;
  return profile;
}

TEST_F(ModbusAxisTest, ATargetBeyondTheDrivesOwnCounterIsReachedTheLongWayOrRefused) {
  SteadyClock clock;
  ModbusAxis axis(profile_that_counts_in_16_bits(), rig_.options(), rig_.bus(), clock);
  axis.home(soon(), {});
  EXPECT_NEAR(axis.move_to(170.0, soon(), {}), 170.0, 0.05);
  EXPECT_NEAR(axis.move_to(300.0, soon(), {}), 300.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 300.0, 0.05) << "30000 steps of 32767";
  EXPECT_NEAR(axis.move_to(40.0, soon(), {}), 40.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), 40.0, 0.05) << "40000 steps would be beyond: the long way";
  EXPECT_NEAR(axis.move_to(320.0, soon(), {}), 320.0, 0.05);
  EXPECT_NEAR(rig_.unwrapped_position(), -40.0, 0.05);
  EXPECT_THAT(failure_of([&] { axis.jog(-290.0, soon(), {}); }),
              testing::AllOf(HasSubstr("-33000 steps"), HasSubstr("from -32768 to 32767")));
  EXPECT_NEAR(rig_.unwrapped_position(), -40.0, 0.05) << "nothing was moved";

  ModbusAxisOptions slide = rig_.options();
  slide.dof = {"slide", "mm", -100.0, 500.0, false};
  ModbusAxis linear(profile_that_counts_in_16_bits(), slide, rig_.bus(), clock);
  EXPECT_THAT(failure_of([&] { linear.move_to(400.0, soon(), {}); }), HasSubstr("that is 40000 steps"));
  EXPECT_NEAR(rig_.unwrapped_position(), -40.0, 0.05);
}

TEST_F(ModbusAxisTest, AMotorLeftMovingIsStoppedBeforeItIsMoved) {
  rig_.axis().home(soon(), {});
  rig_.turn_steadily(3.0);
  while (!rig_.truly_moving()) std::this_thread::yield();
  EXPECT_TRUE(rig_.axis().state(soon()).moving);
  EXPECT_NEAR(rig_.axis().move_to(30.0, soon(), {}), 30.0, 0.05);
  EXPECT_NEAR(rig_.true_position(), 30.0, 0.05);
}

TEST_F(ModbusAxisTest, ReversedAxesAndOffsetsAreHeeded) {
  ModbusAxisOptions options = rig_.options();
  options.reversed = true;
  options.zero_offset = 10.0;
  SteadyClock clock;
  ModbusAxis axis(oriental_motor_az_profile(), options, rig_.bus(), clock);
  axis.home(soon(), {});
  EXPECT_NEAR(axis.state(soon()).position, 350.0, 0.05) << "home lies 10 before the axis's zero";
  axis.move_to(30.0, soon(), {});
  EXPECT_NEAR(rig_.true_position(), 320.0, 0.05) << "30 + 10 the other way";
}

TEST_F(ModbusAxisTest, AnAxisThatIsNotHomedJogsALittleToBeFreed) {
  const double before = rig_.true_position();
  rig_.axis().jog(-4.0, soon(), {});
  EXPECT_NEAR(circular_difference(rig_.true_position(), before, 360.0), -4.0, 0.05);
  EXPECT_THAT(failure_of([&] { rig_.axis().jog(11.0, soon(), {}); }), HasSubstr("10 deg at most"));
  EXPECT_NEAR(circular_difference(rig_.true_position(), before, 360.0), -4.0, 0.05);
}

TEST_F(ModbusAxisTest, AJogIsNeverDoneTwiceWhicheverAnswerIsLost) {
  rig_.axis().home(soon(), {});
  int failures = 0;
  for (int answered = 0; answered < 12; ++answered) {
    const double before = rig_.true_position();
    rig_.faults().add({WireFaultKind::none}, answered);
    rig_.faults().add({WireFaultKind::silence});
    try {
      rig_.axis().jog(3.0, soon(), {});
      EXPECT_NEAR(circular_difference(rig_.true_position(), before, 360.0), 3.0, 0.05) << answered;
    } catch (const DeviceError&) {
      ++failures;
      EXPECT_LT(circular_difference(rig_.true_position(), before, 360.0), 3.05) << answered;
    }
    rig_.faults().clear();
  }
  EXPECT_EQ(failures, 1) << "the jog's own";
}

TEST_F(ModbusAxisTest, SeveralAxesShareOneBus) {
  SteadyClock clock;
  ModbusAxisOptions options = rig_.options();
  options.name = "arm_azimuth";
  options.unit = 2;
  options.dof = {"arm_azimuth", "deg", -90.0, 180.0, false};
  ModbusAxis arm(oriental_motor_az_profile(), options, rig_.bus(), clock);
  rig_.axis().home(soon(), {});
  arm.home(soon(), {});
  std::jthread other([&] { rig_.axis().move_to(90.0, soon(), {}); });
  EXPECT_NEAR(arm.move_to(60.0, soon(), {}), 60.0, 0.05);
  other.join();
  EXPECT_NEAR(rig_.true_position(), 90.0, 0.05);
  EXPECT_NEAR(rig_.lab().axis_position_deg(sim::LabAxis::arm_azimuth, clock.now()), 60.0, 0.05);
  EXPECT_EQ(rig_.bus()->statistics().connections, 1U);
}

TEST_F(ModbusAxisTest, ADriveHasOneMasterAtATime) {
  SteadyClock clock;
  const ModbusBusOptions line{ModbusTcpEndpoint{"127.1", rig_.port()}};  // the same drive, spelt another way
  EXPECT_NO_THROW(rig_.axis().state(soon()));
  ModbusAxisOptions options = rig_.options();
  ModbusAxis rival(oriental_motor_az_profile(), options, std::make_shared<ModbusBus>(line, clock), clock);
  EXPECT_THAT(failure_of([&] { rival.move_to(90.0, soon(), {}); }), HasSubstr("another program drives it"));
  options.unit = 2;
  ModbusAxis neighbour(oriental_motor_az_profile(), options, std::make_shared<ModbusBus>(line, clock), clock);
  EXPECT_NO_THROW(neighbour.state(soon())) << "another drive behind the same gateway";
  rig_.discard_axis();
  rig_.hang_up();
  EXPECT_NO_THROW(rival.state(soon()));
}

TEST(ModbusSerialLine, HasOneMasterAtATimeWhicheverDriveItAsks) {
  ModbusRig rig(ModbusLine::rtu, 0.0);
  SteadyClock clock;
  EXPECT_NO_THROW(rig.axis().state(soon()));
  ModbusAxisOptions options = rig.options();
  options.unit = 2;
  const auto bus = std::make_shared<ModbusBus>(
      ModbusBusOptions{ModbusRtuEndpoint{.device = rig.line(), .parity = 'N'}}, clock);
  ModbusAxis rival(oriental_motor_az_profile(), options, bus, clock);
  EXPECT_THAT(failure_of([&] { rival.state(soon()); }), HasSubstr("another program drives it"));
  EXPECT_NO_THROW(rig.axis().state(soon())) << "and took nothing of what the first one reads";
}

TEST_F(ModbusAxisTest, BacklashOfTheTableIsNotTheDrivesError) {
  rig_.axis().home(soon(), {});
  rig_.drive().set_faults({.backlash_deg = 0.02});
  EXPECT_NEAR(rig_.axis().move_to(30.0, soon(), {}), 30.0, 0.01);
}

class ModbusAxisWatchdog : public ModbusAxisTest {
 protected:
  void SetUp() override { rig_.axis().home(soon(), {}); }
  /// The same table under a drive's watchdog.
  ModbusAxis watched(std::chrono::milliseconds watchdog) {
    ModbusAxisOptions options = rig_.options();
    options.watchdog = watchdog;
    return {oriental_motor_az_profile(), options, rig_.bus(), clock_};
  }
  /// What the drive itself holds; 0: off.
  int armed_ms() {
    std::array<std::uint16_t, 2> registers{};
    EXPECT_EQ(rig_.drive().read(0x138A, registers), sim::ModbusException::none);
    return registers[0] * 65536 + registers[1];
  }
  SteadyClock clock_;
};

TEST_F(ModbusAxisWatchdog, ADeadDriverMeansAStoppedTable) {
  rig_.drive().set_speed_factor(0.1);  // on its own the table would turn for a minute
  ModbusAxis axis = watched(150ms);
  std::jthread mover([&] { EXPECT_THROW(axis.move_to(170.0, soon(), {}), DeviceError); });
  while (!rig_.truly_moving()) std::this_thread::yield();
  rig_.unplug();  // nobody speaks to the drive any more, and nobody can tell it to stop
  mover.join();
  while (rig_.truly_moving()) std::this_thread::yield();
  EXPECT_GT(std::abs(rig_.true_position() - 170.0), 1.0);
  EXPECT_EQ(rig_.drive().alarm(), 0x85);
  rig_.plug_in();
  rig_.slow_down(false);
  EXPECT_NO_THROW(watched(10s).move_to(20.0, soon(), {})) << "an alarm of silence is no reason to refuse";
}

TEST_F(ModbusAxisWatchdog, IsArmedWhileTheTableTurnsAndOffAtRest) {
  rig_.slow_down(true);
  ModbusAxis axis = watched(10s);
  std::jthread mover([&] { axis.move_to(60.0, soon(), {}); });
  while (!rig_.truly_moving()) std::this_thread::yield();
  EXPECT_EQ(armed_ms(), 10'000);
  mover.join();
  EXPECT_EQ(armed_ms(), 0);
}

TEST_F(ModbusAxisWatchdog, IsOffAfterAMoveThatWasStopped) {
  rig_.slow_down(true);
  ModbusAxis axis = watched(10s);
  std::jthread mover([&] { EXPECT_THROW(axis.move_to(170.0, soon(), {}), Interrupted); });
  while (!rig_.truly_moving()) std::this_thread::yield();
  axis.stop_motion();
  mover.join();
  EXPECT_EQ(armed_ms(), 0);
}

TEST(ModbusAxisOptionsCheck, ImpossibleOnesAreRefusedBeforeAnythingIsOpened) {
  SteadyClock clock;
  const auto bus = std::make_shared<ModbusBus>(ModbusBusOptions{ModbusTcpEndpoint{"127.0.0.1", 1}}, clock);
  const auto refused = [&](auto spoil) {
    ModbusAxisOptions options;
    spoil(options);
    EXPECT_THROW(ModbusAxis(oriental_motor_az_profile(), options, bus, clock), std::invalid_argument);
  };
  refused([](ModbusAxisOptions& o) { o.steps_per_unit = 0.0; });
  refused([](ModbusAxisOptions& o) { o.unit = 248; });
  refused([](ModbusAxisOptions& o) { o.speed = -1.0; });
  refused([](ModbusAxisOptions& o) { o.acceleration = 0.0; });
  refused([](ModbusAxisOptions& o) { o.dof.upper = o.dof.lower; });
  refused([](ModbusAxisOptions& o) { o.name.clear(); });
  EXPECT_THROW(ModbusAxis(oriental_motor_az_profile(), {}, nullptr, clock), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
