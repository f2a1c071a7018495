// The DMX lamp on a simulated widget: the conformance suite with and without a bad cable, channels and
// colour.

#include "drivers/usb/enttec_dmx_lamp.h"

#include <memory>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "sim/usb/dmx_widget.h"
#include "sim/usb/sim_link.h"
#include "tests/drivers/lamp_conformance.h"

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
      : cable_(widget_, clock_), channel_(channels.front().number) {
    cable_.set_faults(faults);
    EnttecDmxLampOptions options;
    options.channels = std::move(channels);
    options.response_timeout = 40ms;
    options.attempts = 10;
    lamp_ = std::make_unique<EnttecDmxLamp>(options, std::make_unique<sim::SimLink>(cable_, clock_), clock_);
  }
  Lamp& lamp() override { return *lamp_; }
  void discard_lamp() override { lamp_.reset(); }
  double truth() override { return widget_.channel(channel_) / 255.0; }
  void silence(bool silent) override { cable_.silence(silent); }
  void unplug() override { cable_.unplug(); }
  void plug_in() override { cable_.plug_in(); }

  EnttecDmxLamp& dmx() { return *lamp_; }
  sim::DmxWidget& widget() { return widget_; }

 private:
  SteadyClock clock_;
  sim::DmxWidget widget_;
  sim::Cable cable_;
  int channel_;
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

TEST(EnttecDmxLamp, ChangesItsColourAtTheLevelItHas) {
  DmxRig rig({}, {{1, 1.0}, {2, 1.0}, {3, 1.0}});
  rig.lamp().set_level(1.0, soon());
  rig.dmx().set_color({1.0, 0.0, 0.2}, soon());
  EXPECT_EQ(rig.widget().channel(1), 255);
  EXPECT_EQ(rig.widget().channel(2), 0);
  EXPECT_EQ(rig.widget().channel(3), 51);
  rig.lamp().set_level(0.0, soon());
  EXPECT_EQ(rig.widget().channel(1), 0);
  EXPECT_THROW(rig.dmx().set_color({1.0}, soon()), std::invalid_argument);
  EXPECT_THROW(rig.dmx().set_color({1.0, 0.0, 1.5}, soon()), std::out_of_range);
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
}

}  // namespace
}  // namespace eigenpose
