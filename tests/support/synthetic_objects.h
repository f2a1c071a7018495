#pragma once

/// Small made-up objects that turn before a camera: balls of different colour and size on rods around an
/// axis, drawn nearest last. Enough to learn and recognise in milliseconds, with a knob for every nuisance.

#include <filesystem>
#include <functional>
#include <string>

#include <opencv2/core.hpp>

namespace eigenpose::testing {

struct SceneKnobs {
  int width = 160;
  int height = 120;
  double x = 80.0;  ///< where the object's middle stands, pixels
  double y = 60.0;
  double scale = 1.0;
  double brightness = 1.0;
  int background = 8;
  double noise_sigma = 1.0;  ///< grey levels
  bool color = true;

  /// An object in the middle of a picture.
  static SceneKnobs centred(int width, int height, double scale) {
    SceneKnobs knobs;
    knobs.width = width;
    knobs.height = height;
    knobs.x = 0.5 * width;
    knobs.y = 0.5 * height;
    knobs.scale = scale;
    return knobs;
  }
};

/// Adds object number `kind` (any number; each differs) turned by `angle_deg` to `picture`.
void draw_object(cv::Mat& picture, int kind, double angle_deg, const SceneKnobs& knobs);

/// An empty, noisy picture. `seed` fixes the noise.
cv::Mat empty_scene(const SceneKnobs& knobs, int seed);

/// One object on the background.
cv::Mat scene_with(int kind, double angle_deg, const SceneKnobs& knobs = {}, int seed = 1);

/// Object number for one that looks the same from all sides.
constexpr int symmetric_kind = -1;

/// Writes an image set of `views` pictures evenly around a turn below `root`; `scene` makes each of its angle
/// in degrees and its number.
void write_turn(const std::filesystem::path& root, const std::string& name, int views,
                const std::function<cv::Mat(double, int)>& scene);
void write_turn(const std::filesystem::path& root, const std::string& name, int kind, int views,
                const SceneKnobs& knobs = {});

}  // namespace eigenpose::testing
