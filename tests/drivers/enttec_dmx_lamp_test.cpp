// The DMX lamp on a simulated widget: the conformance suite with and without a bad cable, channels, and lamps
// that share a widget.

#include "drivers/usb/enttec_dmx_lamp.h"

#include <memory>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "sim/usb/dmx_widget.h"
#include "sim/usb/sim_link.h"
#include "tests/drivers/lamp_conformance.h"
#include "tests/drivers/scripted_link.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;

TimePoint soon() {
  return std::chrono::steady_clock::now() + 20s;
}

const sim::CableFaults bad_cable{.lost_from_host = 0.05,
                                 .lost_to_host = 0.1,
                                 .cut_to_host = 0.05,
                                 .damaged_to_host = 0.05,
                                 .delayed_to_host = 0.1,
                                 .delay = 10ms};

class DmxRig final : public LampRig {
 public:
  explicit DmxRig(const sim::CableFaults& faults, std::vector<DmxChannel> channels = {{7, 1.0}})
      : cable_(widget_, clock_), channel_(channels.empty() ? 0 : channels.front().number) {
    cable_.set_faults(faults);
    dmx_ = std::make_shared<EnttecDmxWidget>(EnttecDmxWidgetOptions{.response_timeout = 40ms, .attempts = 10},
                                             std::make_unique<sim::SimLink>(cable_, clock_), clock_);
    lamp_ = another_lamp("lamp", std::move(channels));
  }
  /// On the same widget.
  std::unique_ptr<EnttecDmxLamp> another_lamp(const std::string& name, std::vector<DmxChannel> channels) {
    return std::make_unique<EnttecDmxLamp>(EnttecDmxLampOptions{name, std::move(channels)}, dmx_, clock_);
  }
  Lamp& lamp() override { return *lamp_; }
  void discard_lamp() override { lamp_.reset(); }
  double truth() override { return widget_.channel(channel_) / 255.0; }
  void silence(bool silent) override { cable_.silence(silent); }
  void unplug() override { cable_.unplug(); }
  void plug_in() override { cable_.plug_in(); }

  sim::DmxWidget& widget() { return widget_; }

 private:
  SteadyClock clock_;
  sim::DmxWidget widget_;
  sim::Cable cable_;
  int channel_;
  std::shared_ptr<EnttecDmxWidget> dmx_;
  std::unique_ptr<EnttecDmxLamp> lamp_;
};

INSTANTIATE_TEST_SUITE_P(
    Dmx, LampConformance,
    testing::Values(LampRigCase{"Plain", [] { return std::make_unique<DmxRig>(sim::CableFaults{}); }},
                    LampRigCase{"OnABadCable", [] { return std::make_unique<DmxRig>(bad_cable); }}),
    lamp_rig_name);

TEST(EnttecDmxLamp, SpreadsTheLevelOverItsChannelsAndLeavesTheOthersDark) {
  DmxRig rig({}, {{1, 1.0}, {2, 0.5}, {512, 0.2}});
  rig.lamp().set_level(0.5, soon());
  EXPECT_EQ(rig.widget().channel(1), 128);
  EXPECT_EQ(rig.widget().channel(2), 64);
  EXPECT_EQ(rig.widget().channel(512), 26);  // 25.5, rounded
  for (int channel = 3; channel < 512; ++channel) ASSERT_EQ(rig.widget().channel(channel), 0) << channel;
}

TEST(EnttecDmxLamp, LampsOnOneWidgetLeaveEachOtherAsTheyAre) {
  DmxRig rig({}, {{1, 1.0}});
  auto fill = rig.another_lamp("fill", {{30, 1.0}});
  rig.lamp().set_level(1.0, soon());
  fill->set_level(0.2, soon());
  EXPECT_EQ(rig.widget().channel(1), 255);
  EXPECT_EQ(rig.widget().channel(30), 51);
  rig.lamp().set_level(0.4, soon());
  EXPECT_EQ(rig.widget().channel(1), 102);
  EXPECT_EQ(rig.widget().channel(30), 51);
  fill.reset();
  EXPECT_EQ(rig.widget().channel(30), 0);
  EXPECT_EQ(rig.widget().channel(1), 102) << "the other one still shines";
}

TEST(EnttecDmxLamp, EveryLampOfAWidgetThatWasAwayCountsIt) {
  DmxRig rig({}, {{1, 1.0}});
  auto fill = rig.another_lamp("fill", {{2, 1.0}});
  for (int i = 0; i < 3; ++i) rig.lamp().set_level(1.0, soon());
  fill->set_level(1.0, soon());
  EXPECT_EQ(rig.lamp().interruptions(), 0U);
  EXPECT_EQ(fill->interruptions(), 0U);
  rig.unplug();
  rig.plug_in();
  rig.lamp().set_level(1.0, soon());
  EXPECT_EQ(rig.lamp().interruptions(), 1U);
  EXPECT_EQ(fill->interruptions(), 1U) << "it was without power too, though the first has lit it again";
}

TEST(EnttecDmxLamp, ALevelThatFailedIsNotShownByAnotherLampsFrame) {
  DmxRig rig({}, {{1, 1.0}});
  auto fill = rig.another_lamp("fill", {{2, 1.0}});
  rig.silence(true);
  EXPECT_THROW(rig.lamp().set_level(1.0, soon()), DeviceError);
  rig.silence(false);
  fill->set_level(1.0, soon());
  EXPECT_EQ(rig.widget().channel(2), 255);
  EXPECT_EQ(rig.widget().channel(1), 0);
}

std::vector<std::uint8_t> parameters() {
  return {0x7E, 3, 5, 0, 44, 1, 9, 1, 40, 0xE7};
}

TEST(EnttecDmxWidget, AnAnswerThatWasThereBeforeTheRequestIsNone) {
  const SteadyClock clock;
  auto link = std::make_unique<test::ScriptedLink>(clock);
  test::ScriptedLink& far_end = *link;
  far_end.say(parameters());
  EnttecDmxWidget widget({.response_timeout = 10ms, .attempts = 1}, std::move(link), clock);
  EXPECT_THROW(widget.show("lamp", {{1, 255}}, soon()), DeviceTimeout);
  far_end.on_write = [&](std::span<const std::uint8_t> bytes) {
    if (bytes[1] == 3) far_end.say(parameters());
  };
  EXPECT_NO_THROW(widget.show("lamp", {{1, 255}}, soon()));
}

TEST(EnttecDmxWidget, TriesAsOftenAsItMayAndNotOnceMore) {
  const SteadyClock clock;
  for (const int attempts : {1, 3}) {
    auto link = std::make_unique<test::ScriptedLink>(clock);
    test::ScriptedLink& far_end = *link;
    int frames = 0;
    far_end.on_write = [&](std::span<const std::uint8_t> bytes) { frames += bytes[1] == 6 ? 1 : 0; };
    EnttecDmxWidget widget({.response_timeout = 5ms, .attempts = attempts}, std::move(link), clock);
    EXPECT_THROW(widget.show("lamp", {{1, 255}}, soon()), DeviceTimeout);
    EXPECT_EQ(frames, attempts);
    EXPECT_EQ(far_end.reopenings, attempts - 1);
  }
}

TEST(EnttecDmxWidget, BytesWithoutEndAreNoAnswer) {
  const SteadyClock clock;
  for (const std::vector<std::uint8_t>& bytes :
       {std::vector<std::uint8_t>(128, 0x7E), std::vector<std::uint8_t>(128, 0),
        std::vector<std::uint8_t>{0x7E, 10, 4, 0, 1, 2, 3, 4, 0xE7}}) {
    auto link = std::make_unique<test::ScriptedLink>(clock);
    link->flood = bytes;
    EnttecDmxWidget widget({.response_timeout = 20ms, .attempts = 2}, std::move(link), clock);
    EXPECT_THROW(widget.show("lamp", {{1, 255}}, soon()), DeviceTimeout);
  }
}

TEST(DmxWidgetInTheLab, EveryFrameIsTheWholeUniverse) {
  sim::DmxWidget widget;
  const auto send = [&](std::size_t channels, std::uint8_t value) {
    std::vector<std::uint8_t> bytes = {0x7E, 6, static_cast<std::uint8_t>((channels + 1) & 0xFFU),
                                       static_cast<std::uint8_t>((channels + 1) >> 8U), 0};
    bytes.insert(bytes.end(), channels, value);
    bytes.push_back(0xE7);
    (void)widget.receive(bytes);
  };
  send(512, 200);
  EXPECT_EQ(widget.channel(512), 200);
  send(24, 7);
  EXPECT_EQ(widget.channel(24), 7);
  EXPECT_EQ(widget.channel(25), 0) << "what a shorter frame does not name goes dark";
  send(23, 9);
  EXPECT_EQ(widget.channel(1), 7) << "the widget sends no frame of fewer than 24 channels";
  send(513, 9);
  EXPECT_EQ(widget.channel(1), 7) << "nor one of more than 512";
}

TEST(EnttecDmxLamp, SendsNoFrameBeforeItIsAskedTo) {
  DmxRig rig({});
  rig.discard_lamp();
  EXPECT_EQ(rig.widget().frames(), 0) << "another program's light is left alone";
}

TEST(EnttecDmxLamp, ImpossibleChannelsAreRefused) {
  const auto refused = [](std::vector<DmxChannel> channels) {
    EXPECT_THROW(DmxRig({}, std::move(channels)), std::invalid_argument);
  };
  refused({{0, 1.0}});
  refused({{513, 1.0}});
  refused({{1, 1.1}});
  refused({{1, -0.1}});
  refused({});
}

}  // namespace
}  // namespace eigenpose
