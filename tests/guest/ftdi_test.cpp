// FtdiLink and an APT stage behind it, on an emulated FTDI chip, the kernel's USB and its ftdi_sio. Runs in
// the guest.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include "core/base/error.h"
#include "drivers/usb/apt_axis.h"
#include "drivers/usb/ftdi_link.h"
#include "sim/lab/sim_lab.h"
#include "sim/usb/apt_controller.h"
#include "tests/guest/far_end.h"
#include "tests/guest/recovery_times.h"

namespace eigenpose::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// How much slower the emulated machine may be.
constexpr int slowness = 5;
constexpr Duration return_time = 2s;  ///< within which a device that is back must work again

bool eventually(const std::function<bool()>& condition, Duration patience = slowness * 10s) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < end) {
    if (condition()) return true;
    std::this_thread::sleep_for(10ms);
  }
  return false;
}

/// The hand on the plug: the hub's port is switched off and on.
class Plug {
 public:
  Plug() {
    const auto devices = list_ftdi_devices();
    if (devices.size() != 1) return;
    device_ = "/sys/bus/usb/devices/" + devices.front().bus_path;
    port_ = std::filesystem::canonical(device_ / "port") / "disable";
  }
  ~Plug() { in(); }
  void out() const { std::ofstream(port_) << "1" << std::flush; }
  /// Returns when the kernel has the device. The hub may miss a change that comes while it serves the last
  /// one; then the plug is put in once more.
  void in() const {
    for (int attempt = 0; attempt < 10; ++attempt) {
      std::ofstream(port_) << "0" << std::flush;
      if (eventually([this] { return std::filesystem::exists(device_ / "idVendor"); }, slowness * 1s)) return;
      out();
    }
  }

 private:
  std::filesystem::path device_;
  std::filesystem::path port_;
};

std::size_t open_descriptors() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

/// What is allocated and not freed. (Not what is resident: that grows with every page that is touched first.)
/// What threads keep for themselves of what was freed counts as allocated, so glibc is told to keep nothing.
std::size_t heap_bytes() {
  return mallinfo2().uordblks;
}

/// A cycle takes a second or two; EIGENPOSE_CYCLES sets how many there are.
int cycles() {
  const char* number = std::getenv("EIGENPOSE_CYCLES");
  return number != nullptr ? std::atoi(number) : 20;
}

class FtdiChip : public testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("EIGENPOSE_IN_GUEST") == nullptr)
      GTEST_SKIP() << "only in the guest: tests/guest/run --ftdi --udev";
    ASSERT_TRUE(eventually([] { return list_ftdi_devices().size() == 1; }));
  }
  TimePoint soon() const { return clock_.now() + slowness * 5s; }

  /// Writes and reads back through the far end. @return what came back.
  std::vector<std::uint8_t> there_and_back(FtdiLink& link, const std::vector<std::uint8_t>& bytes) {
    link.write(bytes, soon());
    std::vector<std::uint8_t> back;
    std::array<std::uint8_t, 64> buffer{};
    while (back.size() < bytes.size()) {
      const std::size_t count = link.read(buffer, soon());
      if (count == 0) break;
      back.insert(back.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(count));
    }
    return back;
  }

  SteadyClock clock_;
};

TEST_F(FtdiChip, IsListedWithItsNumbersAndPlace) {
  const FtdiDevice device = list_ftdi_devices().front();
  EXPECT_EQ(device.vendor, 0x0403);
  EXPECT_EQ(device.product, 0x6001);
  EXPECT_TRUE(device.accessible);
  EXPECT_FALSE(device.bus_path.empty());
  EXPECT_FALSE(device.name.empty());
}

TEST_F(FtdiChip, CarriesBytesBothWaysWithoutItsStatusBytes) {
  Echo echo;
  const FarEnd far_end(echo);
  FtdiLink link({}, clock_);
  link.reopen(soon());
  for (const std::size_t length : {1U, 61U, 62U, 63U, 64U, 200U}) {  // around the chip's packet of 62 and two
    std::vector<std::uint8_t> bytes(length);
    for (std::size_t i = 0; i < length; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7 + length);
    EXPECT_EQ(there_and_back(link, bytes), bytes) << length;
  }
}

TEST_F(FtdiChip, WaitsNoLongerThanTheDeadline) {
  FtdiLink link({}, clock_);
  link.reopen(soon());
  link.discard_input();
  std::array<std::uint8_t, 8> buffer{};
  const TimePoint start = clock_.now();
  EXPECT_EQ(link.read(buffer, start + 50ms), 0U);
  EXPECT_GE(clock_.now() - start, 50ms);
  EXPECT_LT(clock_.now() - start, slowness * 1s);
}

TEST_F(FtdiChip, IsFoundByItsSerialNumberAndNoOther) {
  const std::string serial = list_ftdi_devices().front().serial;
  ASSERT_FALSE(serial.empty());
  FtdiLink right({.serial = serial}, clock_);
  EXPECT_NO_THROW(right.reopen(soon()));
  FtdiLink wrong({.serial = serial + "X"}, clock_);
  EXPECT_THROW(wrong.reopen(clock_.now()), DeviceLost);
}

TEST_F(FtdiChip, GivesTheKernelItsDriverBack) {
  const std::filesystem::path tty = "/dev/ttyUSB0";
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(tty); })) << "ftdi_sio has not taken the chip";
  {
    FtdiLink link({}, clock_);
    link.reopen(soon());
    EXPECT_TRUE(eventually([&] { return !std::filesystem::exists(tty); })) << "ftdi_sio was not detached";
  }
  EXPECT_TRUE(eventually([&] { return std::filesystem::exists(tty); })) << "ftdi_sio was not given back";
}

TEST_F(FtdiChip, CannotBeTakenTwice) {
  FtdiLink first({}, clock_);
  first.reopen(soon());
  FtdiLink second({}, clock_);
  try {
    second.reopen(clock_.now());
    FAIL() << "two links on one chip";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another program"));
  }
}

TEST_F(FtdiChip, IsLostInTheMiddleOfAReadAndWorksAgainWhenItIsBack) {
  Echo echo;
  const FarEnd far_end(echo);
  const Plug plug;
  FtdiLink link({}, clock_);
  link.reopen(soon());
  std::jthread hand([&] {
    std::this_thread::sleep_for(100ms);  // into the read
    plug.out();
  });
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_THROW(link.read(buffer, soon()), DeviceLost);
  hand.join();
  EXPECT_THROW(link.write(std::vector<std::uint8_t>{1}, soon()), DeviceLost);
  EXPECT_THROW(link.reopen(clock_.now() + 100ms), DeviceError);
  plug.in();
  link.reopen(soon());
  const std::vector<std::uint8_t> bytes = {1, 2, 3};
  EXPECT_EQ(there_and_back(link, bytes), bytes);
}

TEST_F(FtdiChip, IsUnpluggedAndRepluggedManyTimesWithoutALeak) {
  Echo echo;
  const FarEnd far_end(echo);
  const Plug plug;
  FtdiLink link({}, clock_);
  link.reopen(soon());
  std::size_t descriptors = 0;
  std::vector<std::size_t> heap;
  RecoveryTimes recoveries;
  for (int cycle = 0; cycle < cycles(); ++cycle) {
    plug.out();
    std::array<std::uint8_t, 8> buffer{};
    ASSERT_THROW(
        {
          while (true) link.read(buffer, soon());
        },
        DeviceLost)
        << cycle;
    plug.in();
    ASSERT_TRUE(eventually([] { return !list_ftdi_devices().empty(); })) << cycle;
    const TimePoint back = clock_.now();
    link.reopen(soon());
    const std::vector<std::uint8_t> bytes = {static_cast<std::uint8_t>(cycle), 0x55};
    ASSERT_EQ(there_and_back(link, bytes), bytes) << cycle;
    recoveries.add(clock_.now() - back);
    heap.push_back(heap_bytes());
    if (cycle == 9) descriptors = open_descriptors();  // after what the libraries keep for good
  }
  // A transfer that is under way is no leak, so the least of five cycles is taken.
  ASSERT_GE(heap.size(), 15U);
  const std::size_t before = *std::min_element(heap.begin() + 5, heap.begin() + 10);
  const std::size_t after = *std::min_element(heap.end() - 5, heap.end());
  EXPECT_LT(recoveries.worst(), slowness * return_time);
  EXPECT_EQ(open_descriptors(), descriptors);
  EXPECT_LT(after, before + 16384) << "a link leaked in each cycle is far more";
  recoveries.print();
  std::printf("heap before %zu, after %zu bytes; %zu descriptors\n", before, after, descriptors);
}

TEST_F(FtdiChip, CarriesAnAptStageThroughAnUnplugInTheMiddleOfAMove) {
  sim::SimLab lab(clock_);
  sim::AptController controller(lab, {});
  const FarEnd far_end(controller);
  const Plug plug;
  AptAxisOptions options;
  options.stage = apt_stage("PRM1-Z8");
  options.speed = 20.0;
  options.acceleration = 200.0;
  options.patience.start_time = 1s;
  options.patience.settle_time = 2s;
  options.response_timeout = 1s;
  AptAxis axis(options, std::make_unique<FtdiLink>(FtdiLinkOptions{}, clock_), clock_);
  axis.home(clock_.now() + 60s, {});
  EXPECT_NEAR(axis.move_to(5.0, clock_.now() + 60s, {}), 5.0, 0.02);

  std::jthread hand([&] {
    const double start = lab.axis_position_deg(sim::LabAxis::arm_azimuth, clock_.now());
    while (lab.axis_position_deg(sim::LabAxis::arm_azimuth, clock_.now()) < start + 1.0)
      std::this_thread::sleep_for(1ms);
    plug.out();
  });
  EXPECT_THROW(axis.move_to(60.0, clock_.now() + 60s, {}), DeviceError);
  hand.join();
  plug.in();
  ASSERT_TRUE(eventually([] { return !list_ftdi_devices().empty(); }));
  axis.home(clock_.now() + 60s, {});
  EXPECT_NEAR(axis.move_to(10.0, clock_.now() + 60s, {}), 10.0, 0.02);
  EXPECT_NEAR(lab.axis_position_deg(sim::LabAxis::arm_azimuth, clock_.now()), 10.0, 0.02);
}

}  // namespace
}  // namespace eigenpose::test
