#pragma once

/// A camera that looks at the simulated lab.

#include <optional>

#include "drivers/camera.h"
#include "sim/camera/sensor.h"
#include "sim/camera/shutter.h"
#include "sim/lab/sim_lab.h"
#include "sim/scene/renderer.h"

namespace eigenpose::sim {

struct SimCameraOptions {
  std::string name = "camera";
  int width = 640;   ///< pixels, even
  int height = 480;  ///< pixels, even
  double frames_per_second = 30.0;
  Duration exposure = std::chrono::milliseconds(10);  ///< 10 ms: a white sheet nearly fills the well
  unsigned threads = 1;                               ///< that draw; 0: all cores
  int bounce_rays = 0;                                ///< RenderOptions::bounce_rays
  SensorOptions sensor;
};

/// Each frame shows the lab as it was during its own exposure; what moved in that time is blurred. The noise
/// is a function of the lab's seed and the frame's number. A scene that stands still is drawn once; later
/// frames differ in noise only. The lab must outlive the camera.
class SimCamera final : public Camera {
 public:
  /// @throws std::invalid_argument on options out of range.
  SimCamera(const SimLab& lab, SimCameraOptions options);

  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint deadline, std::stop_token stop) override;
  [[nodiscard]] CameraStatistics statistics() const override { return shutter_.statistics(); }

 private:
  [[nodiscard]] cv::Mat light_of(const Exposure& exposure);
  const cv::Mat& electrons_of(const Exposure& exposure);

  const SimLab& lab_;
  SimCameraOptions options_;
  CameraInfo info_;
  Shutter shutter_;
  Renderer renderer_;
  Sensor sensor_;
  std::optional<SceneState> still_;  ///< the motionless scene that `electrons_` shows
  cv::Mat electrons_;
};

}  // namespace eigenpose::sim
