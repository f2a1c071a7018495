// FtdiLink, an APT stage and a DMX lamp behind it, on an FTDI chip with faults of the bus: the chip stalls,
// answers short, takes nothing, vanishes in the middle of a transfer. Runs in the guest.
#include <array>
#include <chrono>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "drivers/usb/apt_axis.h"
#include "drivers/usb/enttec_dmx_lamp.h"
#include "drivers/usb/ftdi_link.h"
#include "sim/lab/sim_lab.h"
#include "sim/usb/apt_controller.h"
#include "sim/usb/dmx_widget.h"
#include "tests/drivers/axis_conformance.h"
#include "tests/drivers/lamp_conformance.h"
#include "tests/guest/far_end.h"
#include "tests/guest/usb_chip.h"

namespace eigenpose::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

/// For answers and arrivals on an emulated machine that others load.
constexpr auto patience = 20s;

/// The chip that all tests here use: one lives as long as the guest.
UsbChip& chip() {
  static UsbChip the_chip("EP000001");
  return the_chip;
}

/// The chip in its socket, without faults, with `device` behind it. It stays in afterwards: an arrival takes
/// most of a second.
class Socket {
 public:
  explicit Socket(sim::ByteDevice& device) {
    chip().set_faults({});
    chip().wire(&device);
    chip().plug_in();
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    chip().set_faults({});
    chip().wire(nullptr);
  }
};

class FtdiFaults : public testing::Test {
 protected:
  void SetUp() override { link_.reopen(soon()); }
  static void TearDownTestSuite() { chip().unplug(); }

  TimePoint soon() const { return clock_.now() + patience; }
  Bytes read(std::size_t count) {
    Bytes bytes;
    std::array<std::uint8_t, 64> buffer{};
    while (bytes.size() < count) {
      const std::size_t more = link_.read(buffer, soon());
      if (more == 0) break;
      bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(more));
    }
    return bytes;
  }
  void expect_echo(const Bytes& bytes) {
    link_.write(bytes, soon());
    EXPECT_EQ(read(bytes.size()), bytes);
  }
  std::string failure_of(const std::function<void()>& work) {
    try {
      work();
    } catch (const DeviceError& error) {
      return error.what();
    }
    return "no failure";
  }

  SteadyClock clock_;
  Echo echo_;
  Socket socket_{echo_};
  FtdiLink link_{{.serial = chip().serial()}, clock_};
};

TEST_F(FtdiFaults, TheChipInSoftwareCarriesBytesLikeTheOtherOne) {
  Bytes bytes(500);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  expect_echo(bytes);
}

TEST_F(FtdiFaults, AHaltedEndpointIsAnErrorOnceAndThenWorksAgain) {
  chip().set_faults({.stalled_reads = 1});
  EXPECT_THAT(failure_of([&] { (void)read(1); }), HasSubstr("stall"));
  expect_echo({1, 2, 3});

  chip().set_faults({.stalled_writes = 1});
  expect_echo({4});  // after these the endpoint is halted
  EXPECT_THAT(failure_of([&] {
                for (int i = 0; i < 100; ++i) link_.write(Bytes{5}, soon());
              }),
              HasSubstr("stall"));
  link_.reopen(soon());
  expect_echo({6, 7});
}

TEST_F(FtdiFaults, AChipThatRefusesItsRequestsIsNotCalledOpen) {
  chip().set_faults({.refuses_requests = true});
  EXPECT_THAT(failure_of([&] { link_.reopen(clock_.now()); }), HasSubstr("refuses the request"));
  chip().set_faults({});
  link_.reopen(soon());
  expect_echo({1});
}

TEST_F(FtdiFaults, PacketsWithoutTheirStatusBytesCarryNothing) {
  chip().set_faults({.headless_packets = 20});
  expect_echo({1, 2, 3});
  EXPECT_EQ(chip().faults().headless_packets, 0);
}

TEST_F(FtdiFaults, ErrorsThatTheChipReportsAreRaised) {
  chip().set_faults({.line_errors = 0x02});
  EXPECT_THAT(failure_of([&] { (void)read(1); }), HasSubstr("lost in the chip"));
  chip().set_faults({.line_errors = 0x08});
  EXPECT_THAT(failure_of([&] { (void)read(1); }), HasSubstr("baud rate"));
  expect_echo({1});
}

TEST_F(FtdiFaults, AChipThatTakesNoBytesIsATimeoutAndNoHang) {
  chip().set_faults({.deaf = true});
  EXPECT_THROW(
      {
        // The first packet may still find the chip listening.
        for (int i = 0; i < 3; ++i) link_.write(Bytes(64, 1), clock_.now() + 200ms);
      },
      DeviceTimeout);
  chip().set_faults({});
  link_.reopen(soon());
  chip().wire(&echo_);  // forgets what was echoed of the bytes above
  std::array<std::uint8_t, 64> rubbish{};
  while (link_.read(rubbish, clock_.now() + 200ms) > 0) {
  }
  expect_echo({9});
}

TEST_F(FtdiFaults, ASilentChipKeepsToTheDeadline) {
  chip().set_faults({.silent = true});
  link_.write(Bytes{1}, soon());
  std::array<std::uint8_t, 8> buffer{};
  const TimePoint deadline = clock_.now() + 100ms;
  EXPECT_EQ(link_.read(buffer, deadline), 0U);
  EXPECT_GE(clock_.now(), deadline);
}

TEST_F(FtdiFaults, AChipThatVanishesInTheMiddleOfAWriteIsLostAndComesBack) {
  chip().set_faults({.vanishes_after_hearing = 128});
  EXPECT_THROW(link_.write(Bytes(4096, 7), soon()), DeviceLost);
  EXPECT_THROW(link_.write(Bytes{1}, soon()), DeviceLost);
  chip().plug_in();
  link_.reopen(soon());
  expect_echo({1, 2});
}

TEST_F(FtdiFaults, AChipThatVanishesInTheMiddleOfAnAnswerGivesWhatItSaidAndIsLost) {
  chip().set_faults({.vanishes_after_sending = 3});
  link_.write(Bytes{1, 2, 3, 4, 5, 6}, soon());
  EXPECT_EQ(read(3), (Bytes{1, 2, 3}));
  EXPECT_THROW((void)read(1), DeviceLost);
  chip().plug_in();
  link_.reopen(soon());
  expect_echo({8, 9});
}

/// An APT stage of which nothing is imitated but the chip and what stands behind it.
class UsbAptRig final : public AxisRig {
 public:
  UsbAptRig() : lab_(clock_), controller_(lab_, quick_stage()), socket_(controller_) {
    AptAxisOptions options;
    options.stage = apt_stage("PRM1-Z8");
    options.speed = 30.0;
    options.acceleration = 60.0;
    options.patience.poll_interval = 5ms;
    options.patience.start_time = 500ms;
    options.patience.settle_time = 1s;
    options.patience.stall_time = 2s;
    options.response_timeout = 200ms;
    options.attempts = 3;
    auto link = std::make_unique<FtdiLink>(FtdiLinkOptions{.serial = chip().serial()}, clock_);
    link->reopen(clock_.now() + patience);
    axis_ = std::make_unique<AptAxis>(options, std::move(link), clock_);
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
  void slow_down(bool slow) override { controller_.set_speed_factor(slow ? 0.2 * quick : quick); }
  void silence(bool silent) override { chip().set_faults({.silent = silent}); }
  void unplug() override { chip().unplug(); }
  void plug_in() override {
    chip().plug_in();
    FtdiLink({.serial = chip().serial()}, clock_).reopen(clock_.now() + patience);  // until the kernel has it
  }
  void jam(bool jammed) override { controller_.set_faults({.stuck = jammed}); }
  void slip() override { controller_.set_faults({.slip_counts = controller_.options().counts_per_degree}); }
  void raise_alarm() override { controller_.raise_fault("over temperature"); }

 private:
  static constexpr double quick = 12.0;  ///< half a turn takes half a second
  static sim::AptControllerOptions quick_stage() {
    sim::AptControllerOptions options;
    options.speed_factor = quick;
    return options;
  }

  SteadyClock clock_;
  sim::SimLab lab_;
  sim::AptController controller_;
  Socket socket_;
  std::unique_ptr<AptAxis> axis_;
};

INSTANTIATE_TEST_SUITE_P(AptOnUsb, AxisConformance,
                         testing::Values(AxisRigCase{"Ftdi", [] { return std::make_unique<UsbAptRig>(); }}),
                         rig_name);

class UsbDmxRig final : public LampRig {
 public:
  UsbDmxRig() : socket_(widget_) {
    auto link = std::make_unique<FtdiLink>(FtdiLinkOptions{.serial = chip().serial()}, clock_);
    link->reopen(clock_.now() + patience);
    lamp_ = std::make_unique<EnttecDmxLamp>(
        EnttecDmxLampOptions{.channels = {{7, 1.0}}},
        std::make_shared<EnttecDmxWidget>(EnttecDmxWidgetOptions{.response_timeout = 200ms, .attempts = 3},
                                          std::move(link), clock_),
        clock_);
  }
  Lamp& lamp() override { return *lamp_; }
  void discard_lamp() override { lamp_.reset(); }
  double truth() override { return widget_.channel(7) / 255.0; }
  void silence(bool silent) override { chip().set_faults({.silent = silent}); }
  void unplug() override { chip().unplug(); }
  void plug_in() override {
    chip().plug_in();
    FtdiLink({.serial = chip().serial()}, clock_).reopen(clock_.now() + patience);
  }

 private:
  SteadyClock clock_;
  sim::DmxWidget widget_;
  Socket socket_;
  std::unique_ptr<EnttecDmxLamp> lamp_;
};

INSTANTIATE_TEST_SUITE_P(DmxOnUsb, LampConformance,
                         testing::Values(LampRigCase{"Ftdi", [] { return std::make_unique<UsbDmxRig>(); }}),
                         lamp_rig_name);

}  // namespace
}  // namespace eigenpose::test
