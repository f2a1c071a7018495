// V4l2Camera on the kernel's own virtual camera (vivid), with all the faults it can make. Runs in the guest.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "drivers/v4l2/v4l2_camera.h"
#include "tests/drivers/camera_conformance.h"
#include "tests/guest/recovery_times.h"

namespace eigenpose::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// How much slower the emulated machine may be.
constexpr int slowness = 5;

/// The hands on the virtual camera: its fault buttons, and its cable.
class Vivid {
 public:
  static V4l2CameraOptions options() {
    V4l2CameraOptions options;
    options.selector.bus_path = "platform:vivid-000";
    options.mode.width = 320;
    options.mode.height = 180;
    options.mode.color = false;
    return options;
  }

  /// Sets a control, buttons too, through a second opening of the node.
  void set(const std::string& name, std::int32_t value) {
    LinuxVideoSystem system;
    int error = 0;
    const auto device = system.open(find_camera(system.nodes(), options().selector, "vivid").path, error);
    ASSERT_NE(device, nullptr) << error;
    const CameraControls controls(*device);
    const ControlInfo* control = controls.find(name);
    ASSERT_NE(control, nullptr) << name;
    v4l2_control setting{control->id, value};
    ASSERT_EQ(device->control(VIDIOC_S_CTRL, &setting), 0) << name;
  }

  void unplug() { std::ofstream("/sys/bus/platform/drivers/vivid/unbind") << "vivid.0" << std::flush; }
  void plug_in() {
    if (!std::filesystem::exists("/sys/bus/platform/drivers/vivid/vivid.0")) {
      std::ofstream("/sys/bus/platform/drivers/vivid/bind") << "vivid.0" << std::flush;
    }
  }
  /// The camera as it comes out of the box.
  void renew() {
    unplug();
    plug_in();
  }
};

class VividBench final : public CameraBench {
 public:
  VividBench() {
    vivid_.renew();
    camera_ = std::make_unique<V4l2Camera>(Vivid::options(), system_, clock_);
  }
  ~VividBench() override {
    camera_.reset();
    vivid_.plug_in();
  }
  Camera& camera() override { return *camera_; }
  void destroy_camera() override { camera_.reset(); }
  const Clock& clock() override { return clock_; }
  bool stall(bool stalled) override {
    vivid_.set("percentage_of_dropped_buffers", stalled ? 100 : 0);
    return true;
  }
  bool unplug() override {
    vivid_.unplug();
    return true;
  }
  void plug_in() override { vivid_.plug_in(); }
  bool damage_next_frame() override {
    vivid_.set("inject_v4l2_buf_flag_error", 1);
    return true;
  }
  int patience() override { return slowness; }

 private:
  Vivid vivid_;
  SteadyClock clock_;
  LinuxVideoSystem system_;
  std::unique_ptr<V4l2Camera> camera_;
};

INSTANTIATE_TEST_SUITE_P(Vivid, CameraConformance,
                         testing::Values(CameraBenchMaker{"V4l2Camera",
                                                          [] { return std::make_unique<VividBench>(); }}),
                         [](const auto& instance) { return instance.param.name; });

class VividCamera : public testing::Test {
 protected:
  void SetUp() override { vivid_.renew(); }
  void TearDown() override {
    camera_.reset();
    vivid_.plug_in();
  }

  V4l2Camera& open(V4l2CameraOptions options) {
    camera_.reset();
    options.log = [this](const std::string& line) { log_ += line + "\n"; };
    camera_ = std::make_unique<V4l2Camera>(std::move(options), system_, clock_);
    return *camera_;
  }
  Frame next(Duration patience = 5s) { return camera_->next_frame(clock_.now() + slowness * patience, {}); }
  Frame next_after_loss() {
    for (int i = 0; i < 20; ++i) {
      try {
        return next();
      } catch (const DeviceLost&) {
        continue;
      }
    }
    throw std::runtime_error("no frame after 20 calls");
  }

  Vivid vivid_;
  SteadyClock clock_;
  LinuxVideoSystem system_;
  std::unique_ptr<V4l2Camera> camera_;
  std::string log_;
};

TEST_F(VividCamera, DeliversEveryFormatAtTheRateItGrants) {
  for (const PixelFormat format : {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::grey}) {
    for (const bool color : {false, true}) {
      if (color && format == PixelFormat::grey) continue;
      V4l2CameraOptions options = Vivid::options();
      options.mode.formats = {format};
      options.mode.color = color;
      open(options);
      EXPECT_EQ(camera_->info().format, name_of(format));
      EXPECT_EQ(camera_->info().width, 320);
      EXPECT_EQ(camera_->info().height, 180);
      const Frame first = next();
      const TimePoint begin = clock_.now();
      Frame last;
      for (int i = 0; i < 15; ++i) last = next();
      const std::chrono::duration<double> took = clock_.now() - begin;
      const double rate = static_cast<double>(last.sequence - first.sequence) / took.count();
      // The device's own rate, by its sequence numbers: a tenth for the start and end of the measurement,
      // twice that for an emulated machine.
      EXPECT_NEAR(rate, camera_->info().frames_per_second, 0.3 * camera_->info().frames_per_second)
          << name_of(format);
      // The test picture has bars: it is neither black nor flat.
      double darkest = 0.0, brightest = 0.0;
      cv::minMaxLoc(last.image.reshape(1), &darkest, &brightest);
      EXPECT_GT(brightest - darkest, 100.0) << name_of(format);
    }
  }
}

TEST_F(VividCamera, SaysWhichRateWasGrantedWhereTheAskedOneCannotBe) {
  V4l2CameraOptions options = Vivid::options();
  options.mode.width = 1280;
  options.mode.height = 720;
  options.mode.frames_per_second = 60;
  open(options);
  EXPECT_EQ(camera_->info().width, 1280);
  EXPECT_LT(camera_->info().frames_per_second, 60.0);
  EXPECT_DOUBLE_EQ(camera_->report().granted.frames_per_second, camera_->info().frames_per_second);
}

TEST_F(VividCamera, KeepsItsControlsOverALoss) {
  V4l2CameraOptions options = Vivid::options();
  options.controls = {{"gain", 42}, {"brightness", 99}};
  open(options);
  next();
  EXPECT_EQ(camera_->info().controls.at("gain"), 42);
  EXPECT_EQ(camera_->info().controls.at("gain_automatic"), 0);
  vivid_.unplug();
  EXPECT_THROW(
      {
        for (int i = 0; i < 8; ++i) next();
      },
      DeviceLost);
  vivid_.plug_in();
  next_after_loss();
  EXPECT_EQ(camera_->info().controls.at("gain"), 42);
  EXPECT_EQ(camera_->info().controls.at("brightness"), 99);
  EXPECT_EQ(camera_->info().controls.at("gain_automatic"), 0);
}

TEST_F(VividCamera, SurvivesABufferThatTheDriverRefuses) {
  open(Vivid::options());
  for (int i = 0; i < 6; ++i) {
    vivid_.set("inject_vidioc_qbuf_error", 1);
    EXPECT_NO_THROW(next());
    EXPECT_NO_THROW(next());
  }
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
}

TEST_F(VividCamera, OpensAnewAfterAFatalStreamingError) {
  open(Vivid::options());
  const std::uint64_t before = next().sequence;
  vivid_.set("inject_fatal_streaming_error", 1);
  for (int i = 0; i < 8; ++i) EXPECT_GT(next().sequence, before);
  EXPECT_THAT(log_, HasSubstr("broken="));
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
}

TEST_F(VividCamera, ComesBackWhenTheDriverRefusesBuffersOrTheStart) {
  open(Vivid::options());
  for (const char* fault : {"inject_vidioc_reqbufs_error", "inject_vidioc_streamon_error"}) {
    next();
    vivid_.set(fault, 1);
    vivid_.set("inject_fatal_streaming_error", 1);  // so that it opens anew, and meets the fault
    EXPECT_NO_THROW(next_after_loss());
  }
}

TEST_F(VividCamera, ComesBackAfterADisconnectThatLeavesTheNode) {
  open(Vivid::options());
  next();
  vivid_.set("disconnect", 1);
  EXPECT_THROW(
      {
        for (int i = 0; i < 8; ++i) next();
      },
      DeviceLost);
  EXPECT_NO_THROW(next_after_loss());
  EXPECT_EQ(camera_->statistics().times_lost, 1U);
}

TEST_F(VividCamera, CountsFramesTheDriverDrops) {
  open(Vivid::options());
  const std::uint64_t first = next().sequence;
  const std::uint64_t before = camera_->statistics().frames_dropped;
  vivid_.set("percentage_of_dropped_buffers", 50);
  std::uint64_t last = 0;
  for (int i = 0; i < 30; ++i) last = next().sequence;
  vivid_.set("percentage_of_dropped_buffers", 0);
  // Half of about sixty: so far from ten that no luck brings it there.
  EXPECT_GT(camera_->statistics().frames_dropped - before, 10U);
  EXPECT_EQ(camera_->statistics().frames_dropped - before, last - first - 30);
}

TEST_F(VividCamera, IsClosedAndOpenedAnewWhenItStalls) {
  open(Vivid::options());
  next();
  vivid_.set("percentage_of_dropped_buffers", 100);
  EXPECT_THROW(
      {
        for (int i = 0; i < 8; ++i) next();
      },
      DeviceLost);
  vivid_.set("percentage_of_dropped_buffers", 0);
  EXPECT_NO_THROW(next_after_loss());
}

TEST_F(VividCamera, FollowsWrappingSequencesAndDistrustsWrappingTimes) {
  vivid_.set("wrap_sequence_number", 1);
  vivid_.set("wrap_timestamp", 2);
  open(Vivid::options());
  Frame last = next();
  // The sequence starts 128 before its wrap.
  std::uint64_t count = 0;
  while (last.sequence < 150) {
    const Frame frame = next();
    ASSERT_GT(frame.sequence, last.sequence);
    ASSERT_LT(frame.sequence - last.sequence, 100U);
    ASSERT_LE(frame.exposure_start, clock_.now());
    ASSERT_GE(frame.exposure_start, clock_.now() - 2s);
    last = frame;
    ++count;
  }
  EXPECT_EQ(camera_->statistics().frames_taken, count + 1);
}

TEST_F(VividCamera, HasTheCardsNameAndBus) {
  const auto nodes = system_.nodes();
  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].driver, "vivid");
  EXPECT_EQ(nodes[0].bus_info, "platform:vivid-000");
  EXPECT_EQ(nodes[0].port, "vivid.0");
  EXPECT_TRUE(nodes[0].can_capture);
}

std::size_t open_descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

std::size_t resident_kilobytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stoul(line.substr(6));
  }
  return 0;
}

TEST_F(VividCamera, ComesBackAHundredTimesAndLeaksNothing) {
  constexpr int cycles = 100;
  open(Vivid::options());
  next();
  std::size_t descriptors = 0, memory = 0;
  RecoveryTimes recoveries;
  for (int cycle = 1; cycle <= cycles; ++cycle) {
    vivid_.unplug();
    ASSERT_THROW(
        {
          for (int i = 0; i < 8; ++i) next();
        },
        DeviceLost)
        << "cycle " << cycle;
    vivid_.plug_in();
    const TimePoint returned = clock_.now();
    ASSERT_NO_THROW(next_after_loss()) << "cycle " << cycle;
    recoveries.add(clock_.now() - returned);
    if (cycle == 20) {  // by then every pool is filled
      descriptors = open_descriptors();
      memory = resident_kilobytes();
    }
  }
  EXPECT_EQ(camera_->statistics().times_lost, static_cast<std::uint64_t>(cycles));
  EXPECT_LE(recoveries.worst(), slowness * 2s);
  EXPECT_EQ(open_descriptors(), descriptors);
  // One leaked frame or buffer set per cycle would be 5 MB or more.
  EXPECT_LE(resident_kilobytes(), memory + 1024);
  recoveries.print();
  std::printf("resident before %zu, after %zu kB; %zu descriptors\n", memory, resident_kilobytes(),
              descriptors);
}

}  // namespace
}  // namespace eigenpose::test
