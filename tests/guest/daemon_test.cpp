// The whole service on real kernel devices: vivid looped with our own pictures as camera, a turntable over
// Modbus TCP, a stage behind an FTDI chip through libusb. Runs in the guest.

#include <array>
#include <filesystem>
#include <fstream>
#include <optional>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "core/image/image_set.h"
#include "daemon/client/api_client.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "sim/usb/apt_controller.h"
#include "tests/guest/looped_pictures.h"

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

/// A simulated stage's controller at the far end of the emulated FTDI chip, which is the guest's second
/// serial port.
class StageOnTheCable {
 public:
  explicit StageOnTheCable(sim::SimLab& lab) : controller_(lab, quick_stage()) {
    descriptor_ = open("/dev/ttyS1", O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (descriptor_ < 0) throw std::runtime_error("/dev/ttyS1: is the guest run with --ftdi?");
    termios line{};
    cfmakeraw(&line);
    line.c_cflag |= CLOCAL | CREAD;
    line.c_cc[VMIN] = 0;
    line.c_cc[VTIME] = 1;
    cfsetspeed(&line, B115200);
    tcsetattr(descriptor_, TCSANOW, &line);
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
  ~StageOnTheCable() {
    thread_ = {};
    close(descriptor_);
  }
  StageOnTheCable(const StageOnTheCable&) = delete;
  StageOnTheCable& operator=(const StageOnTheCable&) = delete;

 private:
  static sim::AptControllerOptions quick_stage() {
    sim::AptControllerOptions options;
    options.speed_factor = faster;
    return options;
  }

  void serve(const std::stop_token& stop) {
    std::array<std::uint8_t, 256> bytes{};
    while (!stop.stop_requested()) {
      pollfd waits{descriptor_, POLLIN, 0};
      if (poll(&waits, 1, 20) > 0) {
        const ssize_t count = read(descriptor_, bytes.data(), bytes.size());
        if (count > 0) say(controller_.receive({bytes.data(), static_cast<std::size_t>(count)}));
      }
      say(controller_.spontaneous());
    }
  }
  void say(const std::vector<std::uint8_t>& bytes) {
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t count = write(descriptor_, bytes.data() + sent, bytes.size() - sent);
      if (count <= 0) return;  // nobody listens at the other end: an unplugged chip
      sent += static_cast<std::size_t>(count);
    }
  }

  sim::AptController controller_;
  int descriptor_ = -1;
  std::jthread thread_;
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
  /// The chip's serial number, from the system; empty while it is unplugged.
  static std::string serial() {
    for (const auto& entry : fs::directory_iterator("/sys/bus/usb/devices")) {
      std::string vendor, serial;
      std::ifstream(entry.path() / "idVendor") >> vendor;
      std::ifstream(entry.path() / "serial") >> serial;
      if (vendor == "0403") return serial;
    }
    return {};
  }

 private:
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
  const std::string serial_ = serial();
};

class DaemonInTheGuest : public testing::Test {
 protected:
  DaemonInTheGuest()
      : lab_(clock_, {}),
        drives_(lab_, {.speed_factor = faster}),
        stage_(lab_),
        pictures_([this](cv::Mat& luma) { draw(luma); }) {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "rig.toml") << config();
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

  std::string config() const {
    return R"(
[daemon]
runtime_dir = ")" +
           (folder_ / "run").string() + R"("
state_dir = ")" +
           (folder_ / "state").string() + R"("
[camera]
driver = "v4l2"
bus_path = "platform:vivid-000"
format = "YUYV"
color = false
[[axis]]
name = "table"
driver = "modbus"
endpoint = "tcp://127.0.0.1:)" +
           std::to_string(drives_.port()) + R"("
station = 1
settle_ms = 600
[[axis]]
name = "arm"
driver = "apt"
stage = "PRM1-Z8"
endpoint = "usb:)" +
           UsbPlug::serial() + R"("
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
count = 3
[watch]
enabled = false
)";
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
    ASSERT_EQ(set.views().size(), 6U);
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

  const fs::path folder_ = "/run/rig";
  SteadyClock clock_;
  sim::SimLab lab_;
  sim::SimModbusServer drives_;
  StageOnTheCable stage_;
  UsbPlug plug_;
  LoopedPictures pictures_;
};

TEST_F(DaemonInTheGuest, AcquiresAndAcquiresAgainWithCameraAndUsbUnpluggedInTheMiddle) {
  const Service service(folder_ / "rig.toml");
  const ApiClient api = client();

  api.wait_for_job(start(api, "first"));
  check_views("first");

  const std::string job = start(api, "second");
  wait_for_views(api, job, 2);
  pictures_.disconnect();
  api.wait_for_job(job);
  check_views("second");
  EXPECT_GE(api.get("/v1/status").at("camera").at("times_lost").get<int>(), 1);

  // Without the arm the acquisition fails and says so; once it is back, the rest is taken.
  const std::string third = start(api, "third");
  wait_for_views(api, third, 2);
  plug_.pull();
  EXPECT_THROW(api.wait_for_job(third), ApiError);
  plug_.put_back();
  bool done = false;
  std::string trouble;
  for (int attempt = 0; attempt < 20 && !done; ++attempt) {
    try {
      api.wait_for_job(start(api, "third"));
      done = true;
    } catch (const ApiError& error) {
      trouble = error.what();
      clock_.sleep_for(1s);
    }
  }
  EXPECT_TRUE(done) << trouble;
  check_views("third");
}

}  // namespace
}  // namespace eigenpose::test
