// The conformance suite of cameras on those of the simulated lab, in real time.
#include "tests/drivers/camera_conformance.h"

#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "sim/camera/replay_camera.h"
#include "sim/camera/sim_camera.h"

namespace eigenpose::test {
namespace {

constexpr double frames_per_second = 200.0;
constexpr Duration exposure = std::chrono::milliseconds(2);

class SimulatedBench : public CameraBench {
 public:
  Camera& camera() override { return *camera_; }
  void destroy_camera() override { camera_.reset(); }
  const Clock& clock() override { return clock_; }
  bool stall(bool stalled) override {
    lab_.set_camera_faults({.stalled = stalled});
    return true;
  }
  bool unplug() override {
    lab_.set_camera_faults({.lost = true});
    return true;
  }
  void plug_in() override { lab_.set_camera_faults({}); }
  bool damage_next_frame() override {
    // One exposure starts in any span as long as the time between two frames.
    const TimePoint now = clock_.now();
    lab_.damage_frames(now, now + std::chrono::nanoseconds(static_cast<int>(1e9 / frames_per_second)));
    return true;
  }

 protected:
  SteadyClock clock_;
  sim::SimLab lab_{clock_};
  std::unique_ptr<Camera> camera_;
};

class RenderedBench final : public SimulatedBench {
 public:
  RenderedBench() {
    lab_.place("block_a", degrees(20));
    sim::SimCameraOptions options;
    options.width = 64;
    options.height = 48;
    options.frames_per_second = frames_per_second;
    options.exposure = exposure;
    camera_ = std::make_unique<sim::SimCamera>(lab_, options);
  }
};

class ReplayedBench final : public SimulatedBench {
 public:
  ReplayedBench()
      : folder_(std::filesystem::temp_directory_path() /
                ("eigenpose-replayed-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
    for (int index = 0; index < 4; ++index) {
      cv::imwrite((folder_ / ("thing__" + std::to_string(index) + ".png")).string(),
                  cv::Mat(48, 64, CV_8UC1, cv::Scalar(20 * index)));
    }
    sim::ReplayCameraOptions options;
    options.folder = folder_;
    options.degrees_per_index = 90.0;
    options.frames_per_second = frames_per_second;
    options.exposure = exposure;
    camera_ = std::make_unique<sim::ReplayCamera>(lab_, options);
    lab_.place("thing");
  }
  ~ReplayedBench() override { std::filesystem::remove_all(folder_); }

 private:
  std::filesystem::path folder_;
};

INSTANTIATE_TEST_SUITE_P(
    Simulated, CameraConformance,
    testing::Values(CameraBenchMaker{"SimCamera", [] { return std::make_unique<RenderedBench>(); }},
                    CameraBenchMaker{"ReplayCamera", [] { return std::make_unique<ReplayedBench>(); }}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace eigenpose::test
