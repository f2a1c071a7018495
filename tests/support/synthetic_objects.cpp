#include "tests/support/synthetic_objects.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/dataset/image_set.h"

namespace eigenpose::testing {
namespace {

struct Ball {
  double x = 0.0;  ///< across, from the axis
  double y = 0.0;  ///< along the axis, downwards
  double z = 0.0;  ///< towards the camera
  double radius = 0.0;
  cv::Scalar color;
};

std::vector<Ball> balls_of(int kind) {
  std::mt19937 random(static_cast<unsigned>(kind + 100));
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::uniform_real_distribution<double> level(60.0, 250.0);
  const auto color = [&] { return cv::Scalar(level(random), level(random), level(random)); };
  std::vector<Ball> balls;
  if (kind == symmetric_kind) {
    for (int i = 0; i < 3; ++i) balls.push_back({0.0, 12.0 * (i - 1), 0.0, 14.0 - 3.0 * i, color()});
    return balls;
  }
  balls.push_back({0.0, 0.0, 0.0, 14.0, color()});
  for (int i = 0; i < 9; ++i) {
    const double around = std::numbers::pi * unit(random);
    const double out = 14.0 + 8.0 * std::abs(unit(random));
    balls.push_back({out * std::cos(around), 18.0 * unit(random), out * std::sin(around),
                     4.0 + 3.0 * std::abs(unit(random)), color()});
  }
  return balls;
}

}  // namespace

void draw_object(cv::Mat& picture, int kind, double angle_deg, const SceneKnobs& knobs) {
  std::vector<Ball> balls = balls_of(kind);
  const double angle = angle_deg * std::numbers::pi / 180.0;
  for (Ball& ball : balls) {
    const double x = ball.x * std::cos(angle) + ball.z * std::sin(angle);
    ball.z = -ball.x * std::sin(angle) + ball.z * std::cos(angle);
    ball.x = x;
  }
  std::sort(balls.begin(), balls.end(), [](const Ball& a, const Ball& b) { return a.z < b.z; });
  constexpr int fraction_bits = 4;
  constexpr double fraction = 1 << fraction_bits;
  const cv::Point axis(static_cast<int>(std::lround(knobs.x * fraction)),
                       static_cast<int>(std::lround(knobs.y * fraction)));
  for (const Ball& ball : balls) {
    const cv::Point middle(static_cast<int>(std::lround((knobs.x + knobs.scale * ball.x) * fraction)),
                           static_cast<int>(std::lround((knobs.y + knobs.scale * ball.y) * fraction)));
    // A rod holds the ball, so that an object is one piece from all sides.
    cv::line(picture, axis, middle, cv::Scalar::all(90.0 * knobs.brightness),
             static_cast<int>(std::lround(std::max(1.0, 3.0 * knobs.scale))), cv::LINE_AA, fraction_bits);
    cv::Scalar color = ball.color * knobs.brightness;
    if (!knobs.color) color = cv::Scalar::all(0.114 * color[0] + 0.587 * color[1] + 0.299 * color[2]);
    cv::circle(picture, middle, static_cast<int>(std::lround(knobs.scale * ball.radius * fraction)), color,
               cv::FILLED, cv::LINE_AA, fraction_bits);
  }
}

cv::Mat empty_scene(const SceneKnobs& knobs, int seed) {
  cv::Mat picture(knobs.height, knobs.width, knobs.color ? CV_8UC3 : CV_8UC1);
  cv::RNG random(static_cast<std::uint64_t>(seed) + 77);
  random.fill(picture, cv::RNG::NORMAL, knobs.background, knobs.noise_sigma);
  return picture;
}

cv::Mat scene_with(int kind, double angle_deg, const SceneKnobs& knobs, int seed) {
  cv::Mat picture = empty_scene(knobs, seed);
  draw_object(picture, kind, angle_deg, knobs);
  return picture;
}

void write_turn(const std::filesystem::path& root, const std::string& name, int views,
                const std::function<cv::Mat(double, int)>& scene) {
  ImageSetWriter writer(root, name, turntable_workspace(), {{"from", "a test"}}, {.sync_every_view = false});
  for (int i = 0; i < views; ++i) writer.add(scene(360.0 * i / views, i), {360.0 * i / views});
  writer.finish();
}

void write_turn(const std::filesystem::path& root, const std::string& name, int kind, int views,
                const SceneKnobs& knobs) {
  write_turn(root, name, views,
             [&](double angle, int number) { return scene_with(kind, angle, knobs, number); });
}

}  // namespace eigenpose::testing
