#include "sim/camera/sim_camera.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "core/base/angle.h"

namespace eigenpose::sim {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// Exposure at which the sensor's sensitivity is stated.
constexpr Duration nominal_exposure = milliseconds(10);
/// Less motion than this within an exposure is drawn as standing in its middle.
constexpr double blur_worth_drawing_deg = 0.12;

double motion_between(const SceneState& a, const SceneState& b) {
  if (a.objects.size() != b.objects.size() || a.hand.has_value() != b.hand.has_value()) return 360.0;
  double most = 0.0;
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    if (a.objects[i].name != b.objects[i].name) return 360.0;
    // A millimetre is about as visible as two degrees on an object of some centimetres.
    const double way =
        std::hypot(a.objects[i].x_mm - b.objects[i].x_mm, a.objects[i].y_mm - b.objects[i].y_mm,
                   a.objects[i].z_mm - b.objects[i].z_mm);
    most = std::max({most, 2.0 * way,
                     std::abs(circular_difference(a.objects[i].angle_deg, b.objects[i].angle_deg, 360.0))});
  }
  if (a.hand) most = std::max(most, 300.0 * std::abs(*a.hand - *b.hand));
  return std::max({most, 0.3 * std::abs(a.light_azimuth_deg - b.light_azimuth_deg),
                   0.3 * std::abs(a.light_elevation_deg - b.light_elevation_deg)});
}

}  // namespace

SimCamera::SimCamera(const SimLab& lab, SimCameraOptions options)
    : lab_(lab),
      options_(std::move(options)),
      shutter_(lab, options_.name, options_.frames_per_second, options_.exposure),
      renderer_({options_.width, options_.height, options_.threads, options_.bounce_rays}),
      sensor_(options_.sensor) {
  info_.name = options_.name;
  info_.model = "Eigenpose simulated camera";
  info_.serial = "SIM-" + std::to_string(lab.seed());
  info_.format = "simulated";
  info_.width = options_.width;
  info_.height = options_.height;
  info_.frames_per_second = options_.frames_per_second;
  // V4L2 counts exposure_time_absolute in units of 100 µs.
  info_.controls = {
      {"exposure_time_absolute", std::chrono::duration_cast<microseconds>(options_.exposure).count() / 100}};
}

cv::Mat SimCamera::light_of(const Exposure& exposure) {
  const Duration length = exposure.end - exposure.start;
  const double motion = motion_between(lab_.scene_at(exposure.start), lab_.scene_at(exposure.end));
  if (motion < blur_worth_drawing_deg) return renderer_.render(lab_.scene_at(exposure.start + length / 2));
  // Two looks make the blur; its edges need no smoothing of their own.
  cv::Mat sum = renderer_.render(lab_.scene_at(exposure.start + length / 4), false);
  sum += renderer_.render(lab_.scene_at(exposure.start + 3 * length / 4), false);
  return sum * 0.5;
}

const cv::Mat& SimCamera::electrons_of(const Exposure& exposure) {
  SceneState scene = lab_.scene_at(exposure.start);
  const bool still = scene == lab_.scene_at(exposure.end);
  if (still && still_ == scene) return electrons_;
  const double factor =
      std::chrono::duration<double>(options_.exposure) / std::chrono::duration<double>(nominal_exposure);
  electrons_ = sensor_.expose(light_of(exposure), factor);
  still_.reset();
  if (still) still_ = std::move(scene);
  return electrons_;
}

Frame SimCamera::next_frame(TimePoint deadline, std::stop_token stop) {
  const Exposure exposure = shutter_.next(deadline, stop);
  const double extra_noise = lab_.camera_faults().extra_noise;
  Frame frame;
  frame.image =
      sensor_.read(electrons_of(exposure), lab_.seed() * 0x100000001B3ULL + exposure.sequence, extra_noise);
  frame.exposure_start = exposure.start;
  frame.sequence = exposure.sequence;
  return frame;
}

}  // namespace eigenpose::sim
