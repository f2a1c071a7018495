// The APT axis on a simulated controller: the conformance suite with and without a bad cable, and what is
// APT's own.

#include "drivers/usb/apt_axis.h"

#include <cmath>
#include <functional>
#include <memory>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "sim/lab/sim_lab.h"
#include "sim/usb/apt_controller.h"
#include "sim/usb/sim_link.h"
#include "tests/drivers/axis_conformance.h"
#include "tests/drivers/scripted_link.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

TimePoint soon() {
  return std::chrono::steady_clock::now() + 20s;
}

/// What a bad cable does to the answers. No bits are turned: the protocol has no checksum of its own, it
/// relies on that of USB. Requests get through: a move that is lost is told as one that did not start, and
/// that is tested apart.
const sim::CableFaults bad_cable{
    .lost_to_host = 0.04, .cut_to_host = 0.03, .delayed_to_host = 0.1, .delay = 10ms};

class AptRig final : public AxisRig {
 public:
  explicit AptRig(const std::string& stage, const sim::CableFaults& faults)
      : lab_(clock_), controller_(lab_, controller_for(stage)), cable_(controller_, clock_) {
    cable_.set_faults(faults);
    options_.stage = apt_stage(stage);
    options_.speed = 30.0;
    options_.acceleration = 60.0;
    options_.patience.poll_interval = 3ms;
    options_.patience.start_time = 80ms;
    options_.patience.settle_time = 80ms;
    options_.patience.stall_time = 300ms;
    options_.response_timeout = 40ms;
    options_.attempts = faults.lost_to_host > 0.0 ? 8 : 4;
    axis_ = std::make_unique<AptAxis>(options_, std::make_unique<sim::SimLink>(cable_, clock_), clock_);
  }
  Axis& axis() override { return *axis_; }
  void discard_axis() override { axis_.reset(); }
  double true_position() override {
    return wrap(lab_.axis_position_deg(sim::LabAxis::arm_azimuth, clock_.now()), 0.0, 360.0);
  }
  bool truly_moving() override {
    const TimePoint now = clock_.now();
    return lab_.axis_position_deg(sim::LabAxis::arm_azimuth, now) !=
           lab_.axis_position_deg(sim::LabAxis::arm_azimuth, now - 2ms);
  }
  void slow_down(bool slow) override { controller_.set_speed_factor(slow ? 3.0 : 30.0); }
  void silence(bool silent) override { cable_.silence(silent); }
  void unplug() override { cable_.unplug(); }
  void plug_in() override { cable_.plug_in(); }
  void jam(bool jammed) override { controller_.set_faults({.stuck = jammed}); }
  void slip() override { controller_.set_faults({.slip_counts = controller_.options().counts_per_degree}); }
  void raise_alarm() override { controller_.raise_fault("over temperature"); }

  sim::Cable& cable() { return cable_; }
  sim::AptController& controller() { return controller_; }

 private:
  static sim::AptControllerOptions controller_for(const std::string& stage) {
    sim::AptControllerOptions options;
    options.speed_factor = 30.0;
    if (stage == "K10CR1") {
      options.model = "K10CR1";
      options.stepper = true;
      options.counts_per_degree = 136533.33;
      options.velocity_per_degree = 7329109.0;
      options.acceleration_per_degree = 1502.0;
    }
    return options;
  }

  SteadyClock clock_;
  sim::SimLab lab_;
  sim::AptController controller_;
  sim::Cable cable_;
  AptAxisOptions options_;
  std::unique_ptr<AptAxis> axis_;
};

AxisRigCase rig_case(const std::string& name, const std::string& stage, const sim::CableFaults& faults) {
  return {name, [=] { return std::make_unique<AptRig>(stage, faults); }};
}

INSTANTIATE_TEST_SUITE_P(Apt, AxisConformance,
                         testing::Values(rig_case("DcServo", "PRM1-Z8", {}),
                                         rig_case("Stepper", "K10CR1", {}),
                                         rig_case("DcServoOnABadCable", "PRM1-Z8", bad_cable)),
                         rig_name);

class AptAxisTest : public testing::Test {
 protected:
  AptRig rig_{"PRM1-Z8", {}};
};

TEST_F(AptAxisTest, SaysThatItIsAliveSoThatTheControllerGoesOnAnswering) {
  for (int i = 0; i < 120; ++i)
    rig_.axis().state(soon());  // a controller falls silent after 50 unheard updates
  EXPECT_GE(rig_.controller().keep_alives(), 120);
}

TEST_F(AptAxisTest, SaysTheControllersOwnWords) {
  rig_.axis().home(soon(), {});
  rig_.controller().raise_fault("over temperature");
  EXPECT_THAT(*rig_.axis().state(soon()).alarm, HasSubstr("over temperature"));
}

TEST_F(AptAxisTest, AMoveThatNeverReachedTheControllerIsNotCalledArrived) {
  rig_.axis().home(soon(), {});
  // Every message is a piece of its own; a third of them lost means that the move is lost sooner or later.
  rig_.cable().set_faults({.lost_from_host = 0.3});
  for (int i = 0; i < 8; ++i) {
    const double target = i % 2 == 0 ? 20.0 : 10.0;
    try {
      const double reported = rig_.axis().move_to(target, soon(), {});
      EXPECT_NEAR(rig_.true_position(), target, 0.05);
      EXPECT_NEAR(reported, target, 0.05);
    } catch (const DeviceError& error) {
      EXPECT_GT(std::string(error.what()).size(), 20U);
    }
  }
}

TEST_F(AptAxisTest, ALostDeviceIsNamed) {
  rig_.unplug();
  try {
    rig_.axis().state(soon());
    FAIL() << "an unplugged device has answered";
  } catch (const DeviceLost& error) {
    EXPECT_THAT(error.what(), HasSubstr("unplugged"));
    EXPECT_EQ(error.device(), "arm");
  }
}

/// The same arm with other options.
class AptOptionsRig {
 public:
  explicit AptOptionsRig(const std::function<void(AptAxisOptions&)>& change = {}) {
    AptAxisOptions options;
    options.stage = apt_stage("PRM1-Z8");
    options.speed = 30.0;
    options.acceleration = 60.0;
    options.patience = {.poll_interval = 3ms, .start_time = 80ms, .settle_time = 80ms, .stall_time = 300ms};
    if (change) change(options);
    axis_ = std::make_unique<AptAxis>(options, std::make_unique<sim::SimLink>(cable_, clock_), clock_);
  }
  AptAxis& axis() { return *axis_; }
  sim::AptController& controller() { return controller_; }
  double true_position() { return lab_.axis_position_deg(sim::LabAxis::arm_azimuth, clock_.now()); }

 private:
  SteadyClock clock_;
  sim::SimLab lab_{clock_};
  sim::AptController controller_{lab_, {.speed_factor = 30.0}};
  sim::Cable cable_{controller_, clock_};
  std::unique_ptr<AptAxis> axis_;
};

TEST(AptAxisOptionsAtWork, AReversedAxisMovesAndReadsTheOtherWay) {
  AptOptionsRig rig([](AptAxisOptions& o) {
    o.reversed = true;
    o.zero_offset = 10.0;
  });
  rig.axis().home(soon(), {});
  EXPECT_NEAR(rig.axis().state(soon()).position, 350.0, 0.05) << "home lies 10 before the axis's zero";
  EXPECT_NEAR(rig.axis().move_to(30.0, soon(), {}), 30.0, 0.05);
  EXPECT_NEAR(rig.true_position(), -40.0, 0.05) << "30 + 10 the other way";
  EXPECT_NEAR(rig.axis().state(soon()).position, 30.0, 0.05);
}

TEST(AptAxisOptionsAtWork, ALinearRangeIsNotLeftByAJog) {
  AptOptionsRig rig([](AptAxisOptions& o) { o.dof = {"arm", "deg", -20.0, 40.0, false}; });
  rig.axis().home(soon(), {});
  EXPECT_NEAR(rig.axis().jog(35.0, soon(), {}), 35.0, 0.05);
  EXPECT_THROW(rig.axis().jog(6.0, soon(), {}), std::out_of_range);
  EXPECT_NEAR(rig.true_position(), 35.0, 0.05);
  EXPECT_NEAR(rig.axis().jog(5.0, soon(), {}), 40.0, 0.05) << "up to the end";
}

TEST(AptAxisOptionsAtWork, AJogTurnsInItsDirectionByAWholeTurnAtMost) {
  for (const bool reversed : {false, true}) {
    const double sign = reversed ? -1.0 : 1.0;
    AptOptionsRig rig([&](AptAxisOptions& o) { o.reversed = reversed; });
    rig.axis().home(soon(), {});
    EXPECT_NEAR(rig.axis().jog(270.0, soon(), {}), 270.0, 0.05);
    EXPECT_NEAR(sign * rig.true_position(), 270.0, 0.05);
    EXPECT_NEAR(rig.axis().jog(360.0, soon(), {}), 270.0, 0.05);
    EXPECT_NEAR(sign * rig.true_position(), 630.0, 0.05);
    EXPECT_NEAR(rig.axis().jog(-252.0, soon(), {}), 18.0, 0.05);
    EXPECT_NEAR(sign * rig.true_position(), 378.0, 0.05);
    EXPECT_THROW(rig.axis().jog(361.0, soon(), {}), std::out_of_range);
    EXPECT_NEAR(sign * rig.true_position(), 378.0, 0.05);
  }
}

TEST(AptAxisOptionsAtWork, AMotionErrorIsAnAlarmWithoutTheControllersWords) {
  AptOptionsRig rig;
  rig.axis().home(soon(), {});
  rig.controller().set_faults({.stuck = true});
  EXPECT_THROW(rig.axis().move_to(20.0, soon(), {}), DeviceError);
  const AxisState state = rig.axis().state(soon());
  ASSERT_TRUE(state.alarm.has_value());
  EXPECT_THAT(*state.alarm, HasSubstr("blocked or overloaded"));
  EXPECT_THAT([&] { rig.axis().move_to(0.0, soon(), {}); },
              testing::ThrowsMessage<DeviceError>(HasSubstr("blocked or overloaded")));
  rig.controller().set_faults({});
  rig.axis().home(soon(), {});
  EXPECT_FALSE(rig.axis().state(soon()).alarm.has_value());
}

TEST(AptAxisOptionsAtWork, ImpossibleOnesAreRefusedBeforeAnythingIsOpened) {
  const auto refused = [](const std::function<void(AptAxisOptions&)>& spoil) {
    EXPECT_THROW(AptOptionsRig rig(spoil), std::invalid_argument);
  };
  refused([](AptAxisOptions& o) { o.name.clear(); });
  refused([](AptAxisOptions& o) { o.dof.upper = o.dof.lower; });
  refused([](AptAxisOptions& o) { o.stage.counts_per_unit = 0.0; });
  refused([](AptAxisOptions& o) { o.dof.unit = "mm"; });
  refused([](AptAxisOptions& o) { o.channel = 0; });
  refused([](AptAxisOptions& o) { o.speed = -1.0; });
  refused([](AptAxisOptions& o) { o.acceleration = -1.0; });
  refused([](AptAxisOptions& o) { o.arrival_tolerance = -1.0; });
  refused([](AptAxisOptions& o) { o.attempts = 0; });
  refused([](AptAxisOptions& o) { o.attempts = 11; });
}

/// An axis whose controller is the test itself.
struct ScriptedAxis {
  explicit ScriptedAxis(int attempts) {
    auto link = std::make_unique<test::ScriptedLink>(clock);
    far_end = link.get();
    far_end->on_write = [this](std::span<const std::uint8_t> bytes) { hear(bytes); };
    AptAxisOptions options;
    options.stage = apt_stage("PRM1-Z8");
    options.response_timeout = 10ms;
    options.attempts = attempts;
    axis = std::make_unique<AptAxis>(options, std::move(link), clock);
  }
  void hear(std::span<const std::uint8_t> bytes) {
    const int number = bytes[0] | bytes[1] << 8;
    if (number == 0x0005) ++set_ups;
    if (number == 0x0465) ++stops;
    if (!answers) return;
    if (number == 0x0005) answer(0x06, std::vector<std::uint8_t>(84, 0));
    if (number == 0x0490) {
      std::vector<std::uint8_t> status(14, 0);
      status[0] = 1;
      for (int i = 0; i < 4; ++i)
        status[static_cast<std::size_t>(10 + i)] = static_cast<std::uint8_t>(bits >> 8 * i);
      answer(0x91, status);
    }
  }
  void answer(std::uint8_t low, const std::vector<std::uint8_t>& data) const {
    far_end->say(std::vector<std::uint8_t>{low, static_cast<std::uint8_t>(low == 0x06 ? 0x00 : 0x04),
                                           static_cast<std::uint8_t>(data.size()), 0, 0x81, 0x50});
    far_end->say(data);
  }

  SteadyClock clock;
  test::ScriptedLink* far_end = nullptr;
  bool answers = true;
  std::uint32_t bits = 0x80000400;  // enabled, homed
  int set_ups = 0;
  int stops = 0;
  std::unique_ptr<AptAxis> axis;
};

TEST(AptAxisOnAScript, AsksAsOftenAsItMayAndNotOnceMore) {
  for (const int attempts : {1, 3}) {
    ScriptedAxis arm(attempts);
    arm.answers = false;
    EXPECT_THROW(arm.axis->state(soon()), DeviceTimeout);
    EXPECT_EQ(arm.set_ups, attempts);
    EXPECT_EQ(arm.far_end->reopenings, attempts - 1);
  }
}

TEST(AptAxisOnAScript, EachStatusBitHasItsMeaning) {
  ScriptedAxis arm(1);
  const auto state = [&](std::uint32_t bits) {
    arm.bits = bits;
    return arm.axis->state(soon());
  };
  EXPECT_TRUE(state(0x80000400).homed);
  EXPECT_FALSE(state(0x80000000).homed);
  for (const std::uint32_t moving : {0x10U, 0x20U, 0x40U, 0x80U, 0x200U})
    EXPECT_TRUE(state(0x80000400 | moving).moving) << moving;
  for (const std::uint32_t resting : {0x1U, 0x2U, 0x100U, 0x400U})
    EXPECT_FALSE(state(0x80000000 | resting).moving) << resting;
  EXPECT_FALSE(state(0x80000400).alarm.has_value());
  for (const std::uint32_t fault : {0x4000U, 0x01000000U}) {
    ScriptedAxis broken(1);
    broken.bits |= fault;
    EXPECT_THAT(broken.axis->state(soon()).alarm.value_or(""), HasSubstr("blocked or overloaded")) << fault;
  }
}

TEST(AptAxisOnAScript, AControllerIsSetUpAgainWhenItsLinkWasOpenedAnew) {
  ScriptedAxis arm(1);
  (void)arm.axis->state(soon());
  (void)arm.axis->state(soon());
  EXPECT_EQ(arm.set_ups, 1);
  arm.answers = false;
  EXPECT_THROW(arm.axis->state(soon()), DeviceTimeout);
  arm.answers = true;
  (void)arm.axis->state(soon());
  EXPECT_EQ(arm.far_end->reopenings, 1);
  EXPECT_EQ(arm.set_ups, 2) << "it may have been switched off meanwhile";
  (void)arm.axis->state(soon());
  EXPECT_EQ(arm.set_ups, 2);
}

TEST(AptAxisOnAScript, AnAnswerCountsOnlyWhereTheStreamStandsBetweenTwoMessages) {
  ScriptedAxis arm(1);
  (void)arm.axis->state(soon());
  std::vector<std::uint8_t> behind;
  arm.far_end->on_write = [&](std::span<const std::uint8_t> bytes) {
    arm.hear(bytes);
    if (bytes[0] == 0x90) arm.far_end->say(behind);
  };
  const std::vector<std::uint8_t> homed = {0x44, 0x04, 1, 0, 0x01, 0x50};
  for (std::size_t size = 1; size < homed.size(); ++size) {
    behind.assign(homed.begin(), homed.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THROW(arm.axis->state(soon()), DeviceError) << size;
  }
  behind = homed;
  EXPECT_TRUE(arm.axis->state(soon()).homed) << "a whole message may follow";
  behind.clear();
  EXPECT_TRUE(arm.axis->state(soon()).homed);
}

TEST(AptAxisOnAScript, BytesWithoutEndAreNoAnswer) {
  for (const std::vector<std::uint8_t>& bytes :
       {std::vector<std::uint8_t>{0x44, 0x04, 1, 0, 0x01, 0x50},  // "homed", again and again
        std::vector<std::uint8_t>(64, 0x01), std::vector<std::uint8_t>(64, 0xFF)}) {
    ScriptedAxis arm(2);
    arm.answers = false;
    arm.far_end->flood = bytes;
    EXPECT_THROW(arm.axis->state(soon()), DeviceError);
    EXPECT_THROW(arm.axis->move_to(20.0, soon(), {}), DeviceError);
    EXPECT_THROW(arm.axis->stop_motion(), DeviceError);
  }
}

TEST(AptAxisOnAScript, OnlyAnAxisThatMayStillMoveIsStoppedWhenItIsDestroyed) {
  ScriptedAxis resting(1);
  (void)resting.axis->state(soon());
  resting.axis.reset();
  EXPECT_EQ(resting.stops, 0);

  ScriptedAxis unheard(1);
  (void)unheard.axis->state(soon());
  unheard.far_end->on_write = [&](std::span<const std::uint8_t> bytes) {
    if (bytes[0] == 0x53) unheard.answers = false;  // the move goes out, and nothing is heard any more
    unheard.hear(bytes);
  };
  EXPECT_THROW(unheard.axis->move_to(20.0, soon(), {}), DeviceError);
  const int stops = unheard.stops;
  EXPECT_GE(stops, 1) << "told as soon as it failed";
  unheard.axis.reset();
  EXPECT_GT(unheard.stops, stops) << "and once more, because nobody knows";
}

TEST(AptStage, EveryStageHasItsFigures) {
  for (const AptStage& stage : apt_stages()) {
    EXPECT_TRUE(stage.unit == "deg" || stage.unit == "mm") << stage.name;
    EXPECT_GT(stage.counts_per_unit, 0.0) << stage.name;
    EXPECT_GT(stage.velocity_per_unit, stage.counts_per_unit) << stage.name;
    EXPECT_GT(stage.acceleration_per_unit, 0.0) << stage.name;
    EXPECT_GT(stage.speed, 0.0) << stage.name;
  }
  EXPECT_THROW((void)apt_stage("PRM2"), std::invalid_argument);
}

TEST(AptStage, DcServoNumbersFollowTheControllersSamplingInterval) {
  // The protocol's own formula, T = 2048 / 6 MHz: what the tables print agrees with it to the digits they
  // have.
  const double t = 2048.0 / 6e6;
  for (const AptStage& stage : apt_stages()) {
    if (stage.stepper) continue;
    EXPECT_NEAR(stage.velocity_per_unit / (stage.counts_per_unit * t * 65536.0), 1.0, 1e-3) << stage.name;
    EXPECT_NEAR(stage.acceleration_per_unit / (stage.counts_per_unit * t * t * 65536.0), 1.0, 1e-3)
        << stage.name;
  }
}

TEST(AptProtocol, MessagesHaveTheBytesOfTheManual) {
  using testing::ElementsAre;
  EXPECT_THAT(apt::short_message(apt::Message::move_home, 1, 0, 0x50),
              ElementsAre(0x43, 0x04, 1, 0, 0x50, 1));
  EXPECT_THAT(apt::move_absolute(1, 200000, 0x50),
              ElementsAre(0x53, 0x04, 6, 0, 0xD0, 1, 1, 0, 0x40, 0x0D, 0x03, 0x00));
  EXPECT_THAT(apt::move_absolute(1, -1, 0x21),
              ElementsAre(0x53, 0x04, 6, 0, 0xA1, 1, 1, 0, 0xFF, 0xFF, 0xFF, 0xFF));
  EXPECT_EQ(apt::set_velocity(1, 5, 6, 0x50).size(), 20U);
}

TEST(AptProtocol, MessagesAreFoundWhereverTheStreamIsCut) {
  std::vector<std::uint8_t> stream = {0x44, 0x04, 1,  0, 0x01, 0x50,                         // homed
                                      0x91, 0x04, 14, 0, 0x81, 0x50, 1, 0,   0x10, 0, 0, 0,  // status
                                      0,    0,    0,  0, 0x20, 0x04, 0, 0x80};
  for (std::size_t cut = 0; cut <= stream.size(); ++cut) {
    apt::Unpacker unpacker(0x50);
    std::vector<apt::Received> messages;
    const auto take = [&] {
      while (auto message = unpacker.next()) messages.push_back(*message);
    };
    unpacker.feed(std::span(stream).first(cut));
    take();
    unpacker.feed(std::span(stream).subspan(cut));
    take();
    ASSERT_EQ(messages.size(), 2U) << "cut at " << cut;
    EXPECT_EQ(messages[0].number, 0x0444);
    const auto status = apt::status_of(messages[1]);
    ASSERT_TRUE(status.has_value());
    EXPECT_EQ(status->position, 16);
    EXPECT_EQ(status->bits, 0x80000420U);
  }
}

TEST(AptProtocol, BytesThatAreNoMessageAreRefused) {
  apt::Unpacker wrong_destination(0x50);
  wrong_destination.feed(std::vector<std::uint8_t>{0x44, 0x04, 1, 0, 0x02, 0x50});
  EXPECT_THROW((void)wrong_destination.next(), std::runtime_error);
  apt::Unpacker wrong_source(0x50);
  wrong_source.feed(std::vector<std::uint8_t>{0x44, 0x04, 1, 0, 0x01, 0x11});
  EXPECT_THROW((void)wrong_source.next(), std::runtime_error);
  apt::Unpacker too_long(0x50);
  too_long.feed(std::vector<std::uint8_t>{0x91, 0x04, 0, 2, 0x81, 0x50});
  EXPECT_THROW((void)too_long.next(), std::runtime_error);
}

}  // namespace
}  // namespace eigenpose
