/// The operator's hands and eyes: limits of jogging, and what the doctor says of a machine.

#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"
#include "daemon/hardware/checkup.h"
#include "daemon/hardware/hand_control.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// An axis that goes where it is told at once.
class ObedientAxis final : public Axis {
 public:
  ObedientAxis(const Dof& dof, AxisState& state, int& moves) : state_(state), moves_(moves) {
    info_.dof = dof;
  }
  const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint) override { return state_; }
  void home(TimePoint, std::stop_token) override {
    state_.homed = true;
    state_.position = 0.0;
  }
  double move_to(double position, TimePoint, std::stop_token stop) override {
    if (stop.stop_requested()) throw Interrupted();
    if (!state_.homed) throw DeviceError(info_.dof.name, "move", "not homed");
    ++moves_;
    return state_.position = position;
  }
  void stop_motion() override {}

 private:
  AxisInfo info_;
  AxisState& state_;
  int& moves_;
};

class ObedientLamp final : public Lamp {
 public:
  explicit ObedientLamp(double& level) : level_(level) {}
  ~ObedientLamp() override { level_ = 0.0; }
  const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint) override { level_ = level; }
  double level() const override { return level_; }
  std::uint64_t interruptions() const override { return 0; }

 private:
  LampInfo info_{"key", "test lamp"};
  double& level_;
};

class HandControlTest : public testing::Test {
 protected:
  HandControlTest() {
    add_axis("table", {"table", "deg", 0.0, 360.0, true}, table_);
    add_axis("elevation", {"elevation", "deg", -10.0, 80.0, false}, elevation_);
    RigLamp lamp;
    lamp.options.name = "key";
    lamp.open = [this] { return std::make_unique<ObedientLamp>(level_); };
    devices_.lamps.push_back(lamp);
  }
  void add_axis(const std::string& name, const Dof& dof, AxisState& state) {
    RigAxis axis;
    axis.options.dof = dof;
    axis.options.dof.name = name;
    axis.open = [this, dof, &state] { return std::make_unique<ObedientAxis>(dof, state, moves_); };
    devices_.axes.push_back(axis);
  }
  HandControl hands() { return HandControl(devices_, clock_); }

  SteadyClock clock_;
  Devices devices_;
  AxisState table_{350.0, false, true, {}};
  AxisState elevation_{70.0, false, true, {}};
  int moves_ = 0;
  double level_ = 0.0;
};

TEST_F(HandControlTest, JogsToAPositionAndByADistance) {
  HandControl control = hands();
  EXPECT_DOUBLE_EQ(control.jog_to("elevation", 20.0, {}), 20.0);
  EXPECT_DOUBLE_EQ(control.jog_by("elevation", -5.0, {}), 15.0);
  EXPECT_EQ(control.unit_of("elevation"), "deg");
}

TEST_F(HandControlTest, JogsAPeriodicAxisThroughItsSeam) {
  EXPECT_DOUBLE_EQ(hands().jog_by("table", 30.0, {}), 20.0);
}

TEST_F(HandControlTest, RefusesATargetBeyondTheLimitsAndMovesNothing) {
  HandControl control = hands();
  EXPECT_THROW(control.jog_to("elevation", 81.0, {}), std::out_of_range);
  EXPECT_THROW(control.jog_by("elevation", 20.0, {}), std::out_of_range);
  EXPECT_THROW(control.jog_to("elevation", std::nan(""), {}), std::out_of_range);
  EXPECT_EQ(moves_, 0);
}

TEST_F(HandControlTest, WantsAnAxisHomedBeforeItJogsByADistance) {
  elevation_.homed = false;
  HandControl control = hands();
  try {
    control.jog_by("elevation", 5.0, {});
    FAIL();
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("eigenpose home elevation"));
    EXPECT_THAT(error.what(), HasSubstr("2.5 deg at most"));
  }
  EXPECT_THROW(control.jog_by("elevation", 1.0, {}), DeviceError) << "this driver only knows positions";
  control.home("elevation", {});
  EXPECT_DOUBLE_EQ(control.jog_by("elevation", 1.0, {}), 1.0);
}

TEST(HandControlInTheSimulatedLab, TurnsAnArmOnAnAptStageByPositionAndByDistance) {
  const test::TemporaryFolder folder;
  const Config config = parse_config(R"(
[daemon]
runtime_dir = "run"
[sim]
speed_factor = 100.0
[[axis]]
name = "arm"
driver = "apt"
stage = "PRM1-Z8"
endpoint = "simulated"
periodic = false
lower = -90.0
upper = 90.0
)",
                                     folder.path() / "rig.toml");
  fs::create_directories(config.daemon.runtime_dir);
  const SteadyClock clock;
  HandControl control(config, clock);
  EXPECT_THROW(control.jog_to("arm", 10.0, {}), DeviceError) << "not homed";
  control.home("arm", {});
  EXPECT_NEAR(control.jog_to("arm", 30.0, {}), 30.0, 0.05);
  EXPECT_NEAR(control.jog_by("arm", -45.0, {}), -15.0, 0.05);
  EXPECT_THROW(control.jog_by("arm", -80.0, {}), std::out_of_range);
  EXPECT_NEAR(control.state("arm").position, -15.0, 0.05);
}

TEST_F(HandControlTest, NamesTheAxesThereAreWhenAskedForAnother) {
  try {
    hands().jog_to("tabel", 1.0, {});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("table, elevation"));
  }
}

TEST_F(HandControlTest, LampIsLitWithinItsRangeAndGoesDarkAtTheEnd) {
  {
    HandControl control = hands();
    EXPECT_THROW(control.light("key", 1.1), std::out_of_range);
    control.light("key", 0.5);
    EXPECT_DOUBLE_EQ(level_, 0.5);
    EXPECT_THROW(control.light("fill", 0.5), ConfigError);
  }
  EXPECT_DOUBLE_EQ(level_, 0.0);
}

/// A machine made of files.
class CheckupTest : public testing::Test {
 public:
  ~CheckupTest() override { fs::remove_all(root_); }

 protected:
  // One folder a process: ctest runs several cases at a time.
  CheckupTest() : root_(fs::path(testing::TempDir()) / ("eigenpose-machine-" + std::to_string(::getpid()))) {
    fs::remove_all(root_);
    fs::create_directories(root_ / "dev");
    machine_.root = root_;
    machine_.user = "lab";
    machine_.groups = {"video"};
    config_.daemon.runtime_dir = root_ / "run";
    config_.daemon.state_dir = root_ / "state";
  }

  void put(const fs::path& file, const std::string& text) {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text << "\n";
  }
  void plug_in_stage() {
    put("sys/bus/usb/devices/1-2/idVendor", "0403");
    put("sys/bus/usb/devices/1-2/idProduct", "faf0");
    put("sys/bus/usb/devices/1-2/serial", "83123456");
    put("sys/bus/usb/devices/1-2/manufacturer", "Thorlabs");
    put("sys/bus/usb/devices/1-2/product", "APT DC Motor Controller");
    put("sys/bus/usb/devices/1-2/busnum", "1");
    put("sys/bus/usb/devices/1-2/devnum", "4");
    put("dev/bus/usb/001/004", "");
  }
  void add_axis(const std::string& endpoint) {
    AxisOptions axis;
    axis.dof.name = "arm";
    axis.endpoint = endpoint;
    config_.axes.push_back(axis);
  }
  std::vector<Finding> findings() {
    std::vector<Finding> all;
    check_machine(machine_, config_, take_inventory(root_),
                  [&](const Finding& finding) { all.push_back(finding); });
    return all;
  }
  /// The findings on a subject, worst first.
  std::vector<Finding> on(const std::string& subject) {
    std::vector<Finding> some;
    for (const Finding& finding : findings()) {
      if (finding.subject == subject) some.push_back(finding);
    }
    std::stable_sort(some.begin(), some.end(),
                     [](const auto& a, const auto& b) { return a.health > b.health; });
    return some;
  }

  fs::path root_;
  Machine machine_;
  Config config_;
};

TEST_F(CheckupTest, ListsAnFtdiDeviceWithItsSerialAndNode) {
  plug_in_stage();
  put("sys/bus/usb/devices/1-3/idVendor", "046d");
  const Inventory found = take_inventory(root_);
  ASSERT_EQ(found.usb.size(), 1U);
  EXPECT_EQ(found.usb[0].numbers, "0403:faf0");
  EXPECT_EQ(found.usb[0].serial, "83123456");
  EXPECT_EQ(found.usb[0].name, "Thorlabs APT DC Motor Controller");
  EXPECT_EQ(found.usb[0].node, (root_ / "dev/bus/usb/001/004").string());
}

TEST_F(CheckupTest, ACameraThatMayNotBeOpenedIsAFaultWhereItIsTheOneThatTheServiceWouldTake) {
  put("dev/video0", "");
  config_.camera.emplace();
  config_.camera->driver = "v4l2";
  Inventory inventory;
  VideoNode forbidden;
  forbidden.path = (root_ / "dev/video0").string();
  forbidden.serial = "S1";
  forbidden.port = "1-1";
  forbidden.open_error = EACCES;
  inventory.cameras.emplace_back().node = forbidden;
  const auto faults = [&] {
    int count = 0;
    check_machine(machine_, config_, inventory, [&](const Finding& finding) {
      count += finding.subject == "camera" && finding.health == Health::fault ? 1 : 0;
    });
    return count;
  };
  EXPECT_EQ(faults(), 1) << "any camera";
  config_.camera->serial = "S2";
  EXPECT_EQ(faults(), 0) << "another one";
  config_.camera->serial = "S1";
  EXPECT_EQ(faults(), 1);
  config_.camera->bus_path = "usb-0000:00:14.0-1";
  EXPECT_EQ(faults(), 1) << "what cannot be opened does not say its bus";
  config_.camera->device = "/dev/video7";
  EXPECT_EQ(faults(), 0);

  config_.camera->serial.clear();
  config_.camera->bus_path.clear();
  config_.camera->device.clear();
  VideoNode& usable = inventory.cameras.emplace_back().node;
  usable.path = "/dev/video1";
  usable.can_capture = true;
  EXPECT_EQ(faults(), 0) << "the one that can be opened is taken";
  usable.can_capture = false;
  EXPECT_EQ(faults(), 1) << "a node of metadata is no camera";
}

TEST_F(CheckupTest, SaysWhatToPlugInWhenTheSerialNumberIsNotThere) {
  plug_in_stage();
  add_axis("usb:99999999");
  const auto arm = on("axis arm");
  ASSERT_FALSE(arm.empty());
  EXPECT_EQ(arm[0].health, Health::fault);
  EXPECT_THAT(arm[0].what, HasSubstr("99999999"));
  EXPECT_THAT(arm[0].remedy, HasSubstr("83123456"));
}

TEST_F(CheckupTest, MissesTheUdevRulesOnlyWhereUsbIsUsed) {
  add_axis("tcp://10.0.0.1:502");
  EXPECT_TRUE(on("udev rules").empty());
  plug_in_stage();
  add_axis("usb:83123456");
  ASSERT_EQ(on("udev rules").size(), 1U);
  EXPECT_EQ(on("udev rules")[0].health, Health::fault);
  EXPECT_THAT(on("udev rules")[0].remedy, HasSubstr("udevadm"));
  put("etc/udev/rules.d/60-eigenpose.rules", "");
  EXPECT_EQ(on("udev rules")[0].health, Health::good);
}

TEST_F(CheckupTest, FindsAPortWhoseNameHasColonsOfItsOwn) {
  const std::string port = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0";
  put(port.substr(1), "");
  add_axis("rtu:" + port + ":115200:8E1");
  const auto arm = on("axis arm");
  ASSERT_FALSE(arm.empty());
  EXPECT_EQ(arm[0].health, Health::good) << arm[0].what;
}

TEST_F(CheckupTest, MissesTheServicesUserAndItsGroups) {
  EXPECT_THAT(on("service user").at(0).remedy, HasSubstr("systemd-sysusers"));
  put("etc/passwd", "root:x:0:0::/root:/bin/sh\neigenpose:x:990:990::/var/lib/eigenpose:/usr/sbin/nologin");
  for (const char* others : {"", "lab", "eigenpose2", "lab,noeigenpose", "eigenpose-test,lab"}) {
    put("etc/group", std::string("video:x:44:lab,eigenpose\ndialout:x:20:") + others);
    const auto found = on("service user");
    ASSERT_EQ(found.size(), 1U) << others;
    EXPECT_THAT(found[0].what, HasSubstr("'dialout'")) << others;
  }
  for (const char* members : {"eigenpose", "eigenpose,lab", "lab,eigenpose"}) {
    put("etc/group", std::string("video:x:44:eigenpose\ndialout:x:20:") + members);
    EXPECT_TRUE(on("service user").empty()) << members;
  }
}

TEST_F(CheckupTest, LooksAtWhatIsPluggedInWhereThereIsNoConfiguration) {
  plug_in_stage();
  std::vector<std::string> subjects;
  check_found(machine_, take_inventory(root_),
              [&](const Finding& finding) { subjects.push_back(finding.subject); });
  EXPECT_THAT(subjects, testing::ElementsAre("service user", "USB 83123456", "udev rules"));
}

TEST_F(CheckupTest, ListsTheSerialPortsThereAreWhenTheConfiguredOneIsNot) {
  put("sys/devices/usb1/1-1/idVendor", "0403");
  put("sys/devices/usb1/1-1/serial", "A900");
  fs::create_directories(root_ / "sys/devices/usb1/1-1/1-1:1.0/ttyUSB0");
  fs::create_directories(root_ / "sys/class/tty/ttyUSB0");
  fs::create_symlink(root_ / "sys/devices/usb1/1-1/1-1:1.0/ttyUSB0", root_ / "sys/class/tty/ttyUSB0/device");
  put("dev/ttyUSB0", "");
  fs::create_directories(root_ / "dev/serial/by-id");
  fs::create_symlink(root_ / "dev/ttyUSB0", root_ / "dev/serial/by-id/usb-FTDI_A900");
  add_axis("rtu:/dev/ttyUSB7:115200:8E1");
  auto arm = on("axis arm");
  ASSERT_EQ(arm.size(), 1U);
  EXPECT_THAT(arm[0].remedy, HasSubstr("serial/by-id/usb-FTDI_A900"));

  config_.axes[0].endpoint = "rtu:/dev/ttyUSB0";
  arm = on("axis arm");
  ASSERT_EQ(arm.size(), 2U);
  EXPECT_EQ(arm[0].health, Health::note);
  EXPECT_THAT(arm[0].remedy, HasSubstr("by-id"));
  EXPECT_EQ(arm[1].health, Health::good);
}

TEST_F(CheckupTest, AFailingDeviceIsAFindingAndTheOthersAreStillAsked) {
  AxisState state{12.5, false, true, {}};
  int moves = 0;
  Devices devices;
  RigAxis dead, alive;
  dead.options.dof.name = "dead";
  dead.open = []() -> std::unique_ptr<Axis> { throw DeviceTimeout("dead", "read state", "no answer"); };
  alive.options.dof = {"alive", "deg", 0.0, 360.0, true};
  alive.open = [&] { return std::make_unique<ObedientAxis>(Dof{}, state, moves); };
  devices.axes = {dead, alive};
  std::vector<Finding> all;
  const SteadyClock clock;
  check_devices(devices, clock, {}, [&](const Finding& finding) { all.push_back(finding); });
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].health, Health::fault);
  EXPECT_THAT(all[0].remedy, HasSubstr("switched on"));
  EXPECT_EQ(all[1].health, Health::good);
  EXPECT_THAT(all[1].what, HasSubstr("12.50 deg"));
  EXPECT_EQ(moves, 0);
}

/// A camera that never gives a picture.
class BlindCamera final : public Camera {
 public:
  explicit BlindCamera(std::uint64_t damaged) : damaged_(damaged) {}
  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint, std::stop_token) override {
    throw DeviceTimeout("camera", "waiting for a frame", "none came in time");
  }
  [[nodiscard]] CameraStatistics statistics() const override { return {.frames_damaged = damaged_}; }

 private:
  std::uint64_t damaged_;
  CameraInfo info_;
};

TEST_F(CheckupTest, ACameraWithoutAPictureIsToldFromADriveAndADamagedOneFromASilentOne) {
  for (const std::uint64_t damaged : {std::uint64_t{0}, std::uint64_t{40}}) {
    Devices devices;
    devices.camera = [damaged] { return std::make_unique<BlindCamera>(damaged); };
    std::vector<Finding> all;
    const SteadyClock clock;
    check_devices(devices, clock, {}, [&](const Finding& finding) { all.push_back(finding); });
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[1].health, Health::fault);
    EXPECT_EQ(all[1].subject, "camera");
    EXPECT_THAT(all[1].remedy, testing::Not(HasSubstr("drive")));
    EXPECT_THAT(all[1].remedy, HasSubstr(damaged > 0 ? "another cable" : "trigger"));
  }
}

/// A camera that always gives the same picture.
class StillCamera final : public Camera {
 public:
  explicit StillCamera(cv::Mat picture) : picture_(std::move(picture)) {}
  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint, std::stop_token) override {
    Frame frame;
    frame.image = picture_;
    return frame;
  }
  [[nodiscard]] CameraStatistics statistics() const override { return {}; }

 private:
  cv::Mat picture_;
  CameraInfo info_;
};

TEST_F(CheckupTest, ABlackAndASaturatedPictureAreToldFromAGoodOneInEveryDepth) {
  struct Case {
    double level;      ///< of most pixels, as a share of the largest value
    double saturated;  ///< share of the pixels
    Health health;
    const char* what;
  };
  for (const Case& seen :
       {Case{0.0, 0.0, Health::note, "black"}, Case{0.1, 0.0, Health::good, "mean level 10 %"},
        Case{0.1, 0.03, Health::good, "3.0 % saturated"},
        Case{0.1, 0.1, Health::note, "10 % of it is saturated"},
        Case{1.0, 1.0, Health::note, "100 % of it is saturated"}})
    for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1}) {
      const double full = CV_MAT_DEPTH(type) == CV_16U ? 65535.0 : 255.0;
      cv::Mat picture(100, 100, type, cv::Scalar::all(std::round(full * seen.level)));
      picture.rowRange(0, static_cast<int>(std::lround(100 * seen.saturated))).setTo(cv::Scalar::all(full));
      Devices devices;
      devices.camera = [picture] { return std::make_unique<StillCamera>(picture); };
      std::vector<Finding> all;
      const SteadyClock clock;
      check_devices(devices, clock, {}, [&](const Finding& finding) { all.push_back(finding); });
      ASSERT_EQ(all.back().subject, "picture");
      EXPECT_EQ(all.back().health, seen.health) << seen.what << ", type " << type;
      if (seen.health == Health::note || seen.saturated == 0.03) {
        EXPECT_THAT(all.back().what, HasSubstr(seen.what)) << "type " << type;
      }
    }
}

TEST_F(CheckupTest, TellsAnAlarmInTheDrivesWords) {
  AxisState state{0.0, false, true, "overload"};
  int moves = 0;
  Devices devices;
  RigAxis axis;
  axis.options.dof.name = "table";
  axis.open = [&] { return std::make_unique<ObedientAxis>(Dof{}, state, moves); };
  devices.axes = {axis};
  std::vector<Finding> all;
  const SteadyClock clock;
  check_devices(devices, clock, {}, [&](const Finding& finding) { all.push_back(finding); });
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].health, Health::fault);
  EXPECT_THAT(all[0].what, HasSubstr("overload"));
}

}  // namespace
}  // namespace eigenpose
