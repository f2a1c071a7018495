// The conformance suite on V4l2Camera over the imitated kernel, in real time.
#include "drivers/v4l2/v4l2_camera.h"
#include "tests/drivers/camera_conformance.h"
#include "tests/drivers/fake_video_system.h"

namespace eigenpose::test {
namespace {

class V4l2FakeBench final : public CameraBench {
 public:
  explicit V4l2FakeBench(FakeStamp stamp) : system_(fast_camera(stamp), clock_) {
    V4l2CameraOptions options;
    options.mode.frames_per_second = 200;
    options.mode.color = false;
    options.stall_after = std::chrono::seconds(1);
    camera_ = std::make_unique<V4l2Camera>(options, system_, clock_);
  }
  Camera& camera() override { return *camera_; }
  void destroy_camera() override { camera_.reset(); }
  const Clock& clock() override { return clock_; }
  bool stall(bool stalled) override {
    system_.stall(stalled);
    return true;
  }
  bool unplug() override {
    system_.unplug();
    return true;
  }
  void plug_in() override { system_.plug_in(); }
  bool damage_next_frame() override {
    system_.damage(1);
    return true;
  }

 private:
  static FakeCamera fast_camera(FakeStamp stamp) {
    FakeCamera camera = usual_camera();
    camera.modes.front().rates = {200};
    camera.stamp = stamp;
    return camera;
  }

  SteadyClock clock_;
  FakeVideoSystem system_;
  std::unique_ptr<V4l2Camera> camera_;
};

INSTANTIATE_TEST_SUITE_P(
    V4l2, CameraConformance,
    testing::Values(CameraBenchMaker{"StampedAtTheEnd",
                                     [] { return std::make_unique<V4l2FakeBench>(FakeStamp::end_of_frame); }},
                    CameraBenchMaker{"WithoutStamps",
                                     [] { return std::make_unique<V4l2FakeBench>(FakeStamp::unknown); }}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace eigenpose::test
