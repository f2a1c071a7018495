#include "sim/camera/replay_camera.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <opencv2/core.hpp>

#include "core/base/angle.h"
#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "sim/lab/chance.h"
#include "sim/scene/stage.h"

namespace eigenpose::sim {
namespace {

/// "obj3__17" → {"obj3", 17}; nothing for any other form.
std::optional<std::pair<std::string, int>> parsed_stem(const std::string& stem) {
  const std::size_t bar = stem.rfind("__");
  if (bar == std::string::npos || bar == 0 || bar + 2 == stem.size()) return std::nullopt;
  const std::string digits = stem.substr(bar + 2);
  if (digits.size() > 6 ||
      !std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; })) {
    return std::nullopt;
  }
  return std::pair{stem.substr(0, bar), std::stoi(digits)};
}

/// `over` moved by (dx, dy) pixels and laid over `base` by maximum.
void lay_over(cv::Mat& base, const cv::Mat& over, int dx, int dy) {
  const cv::Rect all(0, 0, base.cols, base.rows);
  const cv::Rect target = (all + cv::Point(dx, dy)) & all;
  if (target.empty()) return;
  cv::Mat part = base(target);
  cv::max(part, over(target - cv::Point(dx, dy)), part);
}

}  // namespace

ReplayCamera::ReplayCamera(SimLab& lab, ReplayCameraOptions options)
    : lab_(lab),
      options_(std::move(options)),
      shutter_(lab, options_.name, options_.frames_per_second, options_.exposure) {
  read_folder(lab);
  info_.name = options_.name;
  info_.model = "Eigenpose replay of " + options_.folder.string();
  info_.format = "recorded";
  info_.frames_per_second = options_.frames_per_second;
}

void ReplayCamera::read_folder(SimLab& lab) {
  std::error_code error;
  if (!std::filesystem::is_directory(options_.folder, error)) {
    throw FileError(options_.folder, "is not a folder: name one with pictures OBJECT__INDEX.png");
  }
  cv::Size size;
  int type = 0;
  std::vector<double> corners;
  for (const auto& entry : std::filesystem::directory_iterator(options_.folder)) {
    const auto stem = parsed_stem(entry.path().stem().string());
    if (!stem || entry.path().extension() != ".png") continue;
    cv::Mat picture = load_picture(entry.path());
    if (picture.type() != CV_8UC1 && picture.type() != CV_8UC3) {
      throw FileError(entry.path(), "is not a grey or colour PNG of 8 bits: remove or repair it");
    }
    if (!size.empty() && (picture.size() != size || picture.type() != type)) {
      throw FileError(entry.path(),
                      "has another size or kind than the pictures before it: a replay needs them alike");
    }
    size = picture.size();
    type = picture.type();
    corners.push_back(
        cv::mean(picture(cv::Rect(0, 0, std::min(8, size.width), std::min(8, size.height))))[0]);
    objects_[stem->first][wrap(stem->second * options_.degrees_per_index, 0.0, 360.0)] = std::move(picture);
  }
  if (objects_.empty())
    throw FileError(options_.folder, "holds no picture named OBJECT__INDEX.png: check the path");
  std::nth_element(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(corners.size() / 2),
                   corners.end());
  background_ = corners[corners.size() / 2];
  for (const auto& [name, views] : objects_) lab.add_recorded_object(name);
  info_.width = size.width;
  info_.height = size.height;
}

const cv::Mat& ReplayCamera::nearest(const Views& views, double angle_deg) {
  const auto closer = [&](const auto& a, const auto& b) {
    return std::abs(circular_difference(a.first, angle_deg, 360.0)) <
           std::abs(circular_difference(b.first, angle_deg, 360.0));
  };
  return std::min_element(views.begin(), views.end(), closer)->second;
}

cv::Mat ReplayCamera::composed(const SceneState& scene) const {
  const cv::Mat& any = objects_.begin()->second.begin()->second;
  cv::Mat picture(any.size(), any.type(), cv::Scalar::all(background_));
  const double pixels_per_mm = static_cast<double>(any.cols) / stage::field_width_mm;
  const double foreshortening = std::sin(degrees(stage::camera_elevation_deg).radians());
  for (const PosedObject& object : scene.objects) {
    const auto found = objects_.find(object.name);
    if (found == objects_.end()) continue;
    lay_over(picture, nearest(found->second, object.angle_deg),
             static_cast<int>(std::lround(pixels_per_mm * object.x_mm)),
             static_cast<int>(std::lround(-pixels_per_mm * foreshortening * object.y_mm)));
  }
  if (scene.lamp_level < 1.0) picture *= scene.lamp_level;
  return picture;
}

Frame ReplayCamera::next_frame(TimePoint deadline, std::stop_token stop) {
  const Exposure exposure = shutter_.next(deadline, stop);
  Frame frame;
  frame.image = composed(lab_.scene_at(exposure.start + (exposure.end - exposure.start) / 2));
  frame.exposure_start = exposure.start;
  frame.sequence = exposure.sequence;
  const double noise = std::hypot(options_.noise, lab_.camera_faults().extra_noise);
  if (noise > 0.0) {
    cv::RNG generator(Chance(lab_.seed(), exposure.sequence).next());
    cv::Mat grain(frame.image.size(), CV_16SC(frame.image.channels()));
    generator.fill(grain, cv::RNG::NORMAL, 0.0, noise);
    cv::add(frame.image, grain, frame.image, cv::noArray(), frame.image.depth());
  }
  return frame;
}

}  // namespace eigenpose::sim
