// The whole service on real kernel devices: vivid looped with our own pictures as camera; a turntable over
// Modbus, by TCP or by an FTDI chip's kernel tty; a stage behind an FTDI chip through libusb. Runs in the
// guest.

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <functional>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/dataset/image_set.h"
#include "daemon/api/client/api_client.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "sim/modbus/rtu_server.h"
#include "sim/usb/apt_controller.h"
#include "tests/guest/far_end.h"
#include "tests/guest/looped_pictures.h"
#include "tests/guest/usb_chip.h"

extern char** environ;

namespace eigenpose::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr double faster = 10.0;  ///< than real motors

/// The luma that stands for an angle: 40 at 0°, 220 at 360°.
double luma_of(double angle_deg) {
  return 40.0 + 0.5 * angle_deg;
}

/// eigenposed as a process of its own.
class Service {
 public:
  explicit Service(const fs::path& config) {
    const char* program = std::getenv("EIGENPOSED");
    if (program == nullptr) throw std::runtime_error("EIGENPOSED does not name the program");
    const std::string file = config.string();
    const char* arguments[] = {program, "--config", file.c_str(), nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/run/exchange/eigenposed.log",
                                     O_WRONLY | O_CREAT | O_APPEND, 0644);
    const int error =
        posix_spawn(&process_, program, &actions, nullptr, const_cast<char**>(arguments), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error(std::strerror(error));
  }
  ~Service() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

 private:
  pid_t process_ = 0;
};

/// The plug of the emulated FTDI chip, pulled through QEMU's monitor.
class UsbPlug {
 public:
  UsbPlug() : monitor_(open("/dev/virtio-ports/qmp", O_RDWR | O_CLOEXEC)) {
    if (monitor_ < 0) throw std::runtime_error("no QEMU monitor: is the guest run with --ftdi and --udev?");
    tell(R"({"execute":"qmp_capabilities"})");
  }
  ~UsbPlug() { close(monitor_); }
  UsbPlug(const UsbPlug&) = delete;
  UsbPlug& operator=(const UsbPlug&) = delete;

  void pull() { tell(R"({"execute":"device_del","arguments":{"id":"ftdi0"}})"); }
  /// The same chip: without its serial number QEMU makes one of the port, which is another one the second
  /// time.
  void put_back() {
    tell(R"({"execute":"device_add","arguments":{"driver":"usb-serial","id":"ftdi0","chardev":"ftdi",)"
         R"("always-plugged":true,"serial":")" +
         serial_ + R"("}})");
  }
  [[nodiscard]] const std::string& serial() const { return serial_; }

 private:
  /// From the system: the only chip that is plugged in when this is made.
  static std::string find_serial() {
    for (const auto& entry : fs::directory_iterator("/sys/bus/usb/devices")) {
      std::string vendor, serial;
      std::ifstream(entry.path() / "idVendor") >> vendor;
      std::ifstream(entry.path() / "serial") >> serial;
      if (vendor == "0403") return serial;
    }
    return {};
  }
  void tell(const std::string& line) {
    const std::string command = line + "\n";
    if (write(monitor_, command.data(), command.size()) < 0)
      throw std::runtime_error("the monitor does not listen");
    std::array<char, 4096> answer{};
    pollfd waits{monitor_, POLLIN, 0};
    while (poll(&waits, 1, 300) > 0 && read(monitor_, answer.data(), answer.size()) > 0) {
    }
  }
  const int monitor_;
  const std::string serial_ = find_serial();
};

/// The service, its camera, and the lab that both rigs below turn.
class DaemonInTheGuest : public testing::Test {
 protected:
  DaemonInTheGuest() : lab_(clock_, {}), pictures_([this](cv::Mat& luma) { draw(luma); }) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  /// What the camera sees: a square whose brightness tells the table's angle, and a bar whose brightness
  /// tells the arm's.
  void draw(cv::Mat& luma) {
    const TimePoint now = clock_.now();
    const double table = lab_.axis_position_deg(sim::LabAxis::table, now);
    const double arm = lab_.axis_position_deg(sim::LabAxis::arm_azimuth, now);
    luma(cv::Rect(200, 150, 160, 160)) = luma_of(table - 360.0 * std::floor(table / 360.0));
    luma(cv::Rect(400, 150, 80, 160)) = luma_of(arm + 90.0);
  }

  /// The rig's file, with its two axes where `table` and `arm` say.
  fs::path configured(const std::string& table, const std::string& arm) const {
    std::ofstream(folder_ / "rig.toml") << R"(
[daemon]
runtime_dir = ")" << (folder_ / "run").string()
                                        << R"("
state_dir = ")" << (folder_ / "state").string()
                                        << R"("
[camera]
driver = "v4l2"
bus_path = "platform:vivid-000"
input = 3
format = "YUYV"
color = false
[[axis]]
name = "table"
driver = "modbus"
endpoint = ")" << table << R"("
station = 1
settle_ms = 600
[[axis]]
name = "arm"
driver = "apt"
stage = "PRM1-Z8"
endpoint = ")" << arm << R"("
periodic = false
lower = -90.0
upper = 90.0
settle_ms = 600
[[plan]]
name = "default"
[[plan.axis]]
axis = "arm"
at = [0.0, 20.0]
[[plan.axis]]
axis = "table"
from = 0.0
to = 360.0
count = 2
[watch]
enabled = false
)";
    return folder_ / "rig.toml";
  }

  /// The control socket, once it answers.
  ApiClient client() {
    const ApiClient api(folder_ / "run/control.sock");
    for (int i = 0; i < 300; ++i) {
      try {
        if (api.get("/v1/status").contains("state")) return api;
      } catch (const Error&) {
        clock_.sleep_for(200ms);
      }
    }
    throw std::runtime_error("the service does not answer");
  }

  /// Every view is there and shows the rig as it stood at its own pose.
  void check_views(const std::string& object) {
    const ImageSet set = ImageSet::open(folder_ / "state/sets" / object);
    EXPECT_TRUE(set.complete());
    ASSERT_EQ(set.views().size(), 4U);
    for (std::size_t i = 0; i < set.views().size(); ++i) {
      cv::Mat view = set.load(i);
      if (view.channels() == 3) cv::cvtColor(view, view, cv::COLOR_BGR2GRAY);
      const double arm = set.views()[i].q[0], table = set.views()[i].q[1];
      // Luma is spread from 16…235 to 0…255 on the way. Two levels: rounding there, in drawing, and the
      // drive's own step.
      const auto expected = [](double angle) { return (luma_of(angle) - 16.0) * 255.0 / 219.0; };
      EXPECT_NEAR(cv::mean(view(cv::Rect(220, 170, 120, 120)))[0], expected(table), 2.0)
          << "table at " << table;
      EXPECT_NEAR(cv::mean(view(cv::Rect(410, 170, 60, 120)))[0], expected(arm + 90.0), 2.0)
          << "arm at " << arm;
    }
  }

  /// Waits until every axis has answered.
  void wait_for_axes(const ApiClient& api) {
    nlohmann::json axes;
    for (int i = 0; i < 600; ++i) {
      axes = api.get("/v1/status").at("axes");
      if (std::none_of(axes.begin(), axes.end(),
                       [](const auto& axis) { return axis.at("position").is_null(); }))
        return;
      clock_.sleep_for(100ms);
    }
    FAIL() << axes.dump();
  }

  std::string start(const ApiClient& api, const std::string& object) {
    return api.post("/v1/acquisitions", {{"object", object}, {"plan", "default"}})
        .at("id")
        .get<std::string>();
  }

  /// Waits until the job has taken `views` views.
  void wait_for_views(const ApiClient& api, const std::string& job, int views) {
    for (int i = 0; i < 600; ++i) {
      const auto now = api.get("/v1/jobs/" + job);
      ASSERT_EQ(now.at("state"), "running") << now.dump();
      if (now.at("done").get<int>() >= views) return;
      clock_.sleep_for(100ms);
    }
    FAIL() << "the job takes no views";
  }

  /// An acquisition in the middle of which an axis goes away: it fails and names the axis; once that is back,
  /// the same command takes the rest.
  void expect_completed_after_loss(const ApiClient& api, const std::string& object, const std::string& axis,
                                   const std::function<void()>& pull, const std::function<void()>& put_back) {
    wait_for_axes(api);
    const std::string job = start(api, object);
    wait_for_views(api, job, 2);
    pull();
    try {
      api.wait_for_job(job);
      ADD_FAILURE() << "no failure although " << axis << " is away";
    } catch (const ApiError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(axis + ": "));
    }
    put_back();
    bool done = false;
    std::string trouble;
    for (int attempt = 0; attempt < 20 && !done; ++attempt) {
      try {
        api.wait_for_job(start(api, object));
        done = true;
      } catch (const ApiError& error) {
        trouble = error.what();
        clock_.sleep_for(1s);
      }
    }
    EXPECT_TRUE(done) << trouble;
    check_views(object);
  }

  static sim::AptControllerOptions quick_stage() {
    sim::AptControllerOptions options;
    options.speed_factor = faster;
    return options;
  }

  const fs::path folder_ = "/run/rig";
  SteadyClock clock_;
  sim::SimLab lab_;
  UsbPlug plug_;
  LoopedPictures pictures_;
};

TEST_F(DaemonInTheGuest, AcquiresAgainAfterCameraAndArmWereUnpluggedWithTheTableOnTcp) {
  sim::SimModbusServer drives(lab_, {.speed_factor = faster});
  sim::AptController stage(lab_, quick_stage());
  const FarEnd cable(stage);
  const Service service(
      configured("tcp://127.0.0.1:" + std::to_string(drives.port()), "usb:" + plug_.serial()));
  const ApiClient api = client();

  api.wait_for_job(start(api, "first"));
  check_views("first");

  const std::string job = start(api, "second");
  wait_for_views(api, job, 2);
  pictures_.disconnect();
  api.wait_for_job(job);
  check_views("second");
  EXPECT_GE(api.get("/v1/status").at("camera").at("times_lost").get<int>(), 1);

  expect_completed_after_loss(
      api, "third", "arm", [this] { plug_.pull(); }, [this] { plug_.put_back(); });
}

TEST_F(DaemonInTheGuest, AcquiresAgainAfterTableAndArmWereUnpluggedWithTheTableOnTheKernelsTty) {
  const fs::path line = folder_ / "line";
  sim::SimRtuServer drives(lab_, {.port = line, .speed_factor = faster});
  Terminal terminal(line);
  const FarEnd cable(terminal);
  sim::AptController stage(lab_, quick_stage());
  UsbChip arm("EP000001");
  arm.wire(&stage);
  arm.plug_in();
  const std::string tty = "/dev/serial/by-id/usb-QEMU_QEMU_USB_SERIAL_" + plug_.serial() + "-if00-port0";
  for (int i = 0; i < 300 && !fs::exists(tty); ++i) clock_.sleep_for(100ms);
  ASSERT_TRUE(fs::exists(tty)) << tty;
  const Service service(configured("rtu:" + tty + ":115200:8E1", "usb:" + arm.serial()));
  const ApiClient api = client();

  expect_completed_after_loss(
      api, "first", "table", [this] { plug_.pull(); }, [this] { plug_.put_back(); });
  expect_completed_after_loss(
      api, "second", "arm", [&] { arm.unplug(); }, [&] { arm.plug_in(); });
}

}  // namespace
}  // namespace eigenpose::test
