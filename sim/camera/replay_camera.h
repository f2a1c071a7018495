#pragma once

/// A camera that shows recorded photographs instead of a rendered lab: for each turntable angle the nearest
/// one.

#include <filesystem>
#include <map>
#include <vector>

#include "drivers/camera.h"
#include "sim/camera/shutter.h"
#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

struct ReplayCameraOptions {
  std::string name = "camera";
  std::filesystem::path folder;  ///< pictures named OBJECT__INDEX.png, all of one size
  double degrees_per_index =
      5.0;  ///< turntable angle of a picture = INDEX × this; 1 where names hold degrees
  double frames_per_second = 30.0;
  Duration exposure = std::chrono::milliseconds(10);
  double noise = 1.0;  ///< standard deviation added to each frame, grey levels of 255
};

/// Shows what the lab's control placed, at its yaw + table angle in the middle of the exposure. Several
/// objects are laid over each other by maximum, moved by their place on the table; an empty table is a dark
/// picture. Objects of other kinds, the light arm and the hand are not seen; the lamp's level dims the
/// picture. The lab must outlive it.
class ReplayCamera final : public Camera {
 public:
  /// Reads all pictures and adds the objects' names to the lab. @throws FileError when the folder holds none,
  /// one cannot be read, or sizes differ.
  ReplayCamera(SimLab& lab, ReplayCameraOptions options);

  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint deadline, std::stop_token stop) override;
  [[nodiscard]] CameraStatistics statistics() const override { return shutter_.statistics(); }

 private:
  /// Pictures of one object by angle in degrees, [0, 360).
  using Views = std::map<double, cv::Mat>;
  void read_folder(SimLab& lab);
  [[nodiscard]] static const cv::Mat& nearest(const Views& views, double angle_deg);
  [[nodiscard]] cv::Mat composed(const SceneState& scene) const;

  const SimLab& lab_;
  ReplayCameraOptions options_;
  CameraInfo info_;
  Shutter shutter_;
  std::map<std::string, Views> objects_;
  double background_ = 0.0;  ///< of an empty table, grey levels: the usual level of the pictures' corners
};

}  // namespace eigenpose::sim
