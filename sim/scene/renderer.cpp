#include "sim/scene/renderer.h"

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/base/parallel.h"
#include "sim/scene/stage.h"
#include "sim/scene/tracer.h"

namespace eigenpose::sim {
namespace {

/// Two neighbours that differ more than this (relative to their brightness) get four rays.
constexpr float contrast_for_more_rays = 0.12F;

cv::Vec3f as_pixel(Vec3 colour) {
  return {colour.z, colour.y, colour.x};
}  // OpenCV keeps blue first

/// Pixels in which a sphere is seen, cut to the picture and widened to even numbers.
cv::Rect seen_rect(const Pinhole& camera, Vec3 center, float radius, cv::Size size) {
  float x = 0.0F;
  float y = 0.0F;
  camera.project(center, x, y);
  const float r = 1.02F * radius * camera.pixels_per_mm(center) + 2.0F;
  const auto floor_even = [](float v) { return static_cast<int>(std::floor(v)) & ~1; };
  const cv::Rect all(0, 0, size.width, size.height);
  const int left = floor_even(x - r);
  const int top = floor_even(y - r);
  return cv::Rect(left, top, floor_even(x + r) + 2 - left, floor_even(y + r) + 2 - top) & all;
}

/// Where the shadow of a sphere may fall on the table: a rectangle around its outline's projection from the
/// lamp.
cv::Rect shadow_rect(const Pinhole& camera, Vec3 lamp, Vec3 center, float radius, cv::Size size) {
  float left = 1e9F;
  float top = 1e9F;
  float right = -1e9F;
  float bottom = -1e9F;
  for (int i = 0; i < 27; ++i) {
    const Vec3 corner =
        center + radius * Vec3{static_cast<float>(i % 3 - 1), static_cast<float>(i / 3 % 3 - 1),
                               static_cast<float>(i / 9 - 1)};
    Vec3 way = corner - lamp;
    // A lamp near the table's plane throws shadows without end; the picture's border ends them here.
    way.z = std::min(way.z, -0.02F * length(way));
    const float t = std::max(0.0F, (-stage::table_height_mm - corner.z) / way.z);
    float x = 0.0F;
    float y = 0.0F;
    camera.project(corner + t * way, x, y);
    left = std::min(left, x);
    right = std::max(right, x);
    top = std::min(top, y);
    bottom = std::max(bottom, y);
  }
  const auto even = [](float v, int limit) {
    return static_cast<int>(std::clamp(std::floor(v), 0.0F, static_cast<float>(limit))) & ~1;
  };
  const int x0 = even(left, size.width);
  const int y0 = even(top, size.height);
  return cv::Rect(x0, y0, even(right + 2.0F, size.width + 1) - x0,
                  even(bottom + 2.0F, size.height + 1) - y0) &
         cv::Rect(0, 0, size.width, size.height);
}

bool contrasts(const cv::Vec3f& a, const cv::Vec3f& b) {
  float difference = 0.0F;
  float sum = 0.05F;
  for (int c = 0; c < 3; ++c) {
    difference = std::max(difference, std::abs(a[c] - b[c]));
    sum += a[c] + b[c];
  }
  return difference > contrast_for_more_rays * sum;
}

/// A frame in the making.
struct Canvas {
  cv::Mat once;    ///< CV_32FC3: one ray a pixel
  cv::Mat what;    ///< CV_32SC1: Sample::what
  cv::Mat active;  ///< CV_8UC1: cast rays here
};

void cast_once(const Tracer& tracer, const Pinhole& camera, Canvas& canvas, int row) {
  for (int x = 0; x + 1 < canvas.once.cols; x += 2) {
    if (canvas.active.at<std::uint8_t>(row, x) == 0) continue;
    std::array<Vec3, 4> directions;
    for (int k = 0; k < 4; ++k) {
      directions[static_cast<std::size_t>(k)] =
          camera.direction(static_cast<float>(x + (k & 1)) + 0.5F, static_cast<float>(row + (k >> 1)) + 0.5F);
    }
    const auto samples = tracer.sample(directions);
    for (int k = 0; k < 4; ++k) {
      const Sample& sample = samples[static_cast<std::size_t>(k)];
      canvas.once.at<cv::Vec3f>(row + (k >> 1), x + (k & 1)) = as_pixel(sample.colour);
      canvas.what.at<int>(row + (k >> 1), x + (k & 1)) = sample.what;
    }
  }
}

void refine_edges(const Tracer& tracer, const Pinhole& camera, const Canvas& canvas, cv::Mat& picture,
                  int y) {
  constexpr std::array<std::array<float, 2>, 4> grid{
      {{0.375F, 0.125F}, {0.875F, 0.375F}, {0.125F, 0.625F}, {0.625F, 0.875F}}};
  for (int x = 0; x < picture.cols; ++x) {
    if (canvas.active.at<std::uint8_t>(y, x) == 0) continue;
    const int what = canvas.what.at<int>(y, x);
    const cv::Vec3f& here = canvas.once.at<cv::Vec3f>(y, x);
    const auto differs = [&](int nx, int ny) {
      if (nx < 0 || ny < 0 || nx >= picture.cols || ny >= picture.rows) return false;
      const int other = canvas.what.at<int>(ny, nx);
      if (what < 0 && other < 0) return false;  // shadows on the dark table need no care
      return what != other || contrasts(here, canvas.once.at<cv::Vec3f>(ny, nx));
    };
    if (!differs(x - 1, y) && !differs(x + 1, y) && !differs(x, y - 1) && !differs(x, y + 1)) continue;
    std::array<Vec3, 4> directions;
    for (std::size_t k = 0; k < 4; ++k) {
      directions[k] =
          camera.direction(static_cast<float>(x) + grid[k][0], static_cast<float>(y) + grid[k][1]);
    }
    Vec3 sum;
    for (const Sample& sample : tracer.sample(directions)) {
      // A highlight counts as much as the sensor can hold, or it would glare over its edge.
      sum += Vec3{std::min(sample.colour.x, 1.5F), std::min(sample.colour.y, 1.5F),
                  std::min(sample.colour.z, 1.5F)};
    }
    picture.at<cv::Vec3f>(y, x) = as_pixel(0.25F * sum);
  }
}

}  // namespace

struct Renderer::Setting {
  Pinhole camera;
  Light light;
};

Renderer::Renderer(RenderOptions options) : options_(options) {
  const auto usable = [](int side) { return side >= 16 && side <= 4096 && side % 2 == 0; };
  if (!usable(options.width) || !usable(options.height)) {
    throw std::invalid_argument(
        "a rendered picture has an even number of pixels from 16 to 4096 a side, not " +
        std::to_string(options.width) + " x " + std::to_string(options.height));
  }
  if (options.bounce_rays < 0 || options.bounce_rays % 4 != 0) {
    throw std::invalid_argument("rays for bounced light go in fours, not " +
                                std::to_string(options.bounce_rays));
  }
}

Renderer::~Renderer() = default;

const cv::Mat& Renderer::empty_stage(const Setting& setting) {
  if (empty_light_ && empty_light_->light == setting.light) return empty_;
  empty_.create(options_.height, options_.width, CV_32FC3);
  const Tracer tracer(setting.camera, setting.light, {}, 0);
  parallel_for(static_cast<std::size_t>(options_.height), options_.threads, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < options_.width; ++x) {
      const Vec3 direction =
          setting.camera.direction(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      empty_.at<cv::Vec3f>(y, x) = as_pixel(tracer.stage_colour(direction, false));
    }
  });
  empty_light_ = std::make_unique<Setting>(setting);
  return empty_;
}

cv::Mat Renderer::render(const SceneState& scene) {
  const Setting setting{Pinhole(options_.width, options_.height), light_of(scene)};
  const cv::Size size(options_.width, options_.height);
  cv::Mat picture = empty_stage(setting).clone();
  const Tracer tracer(setting.camera, setting.light, bodies_of(scene), options_.bounce_rays);
  if (tracer.bodies().empty()) return picture;

  Canvas canvas{picture.clone(), cv::Mat(size, CV_32SC1, cv::Scalar(-1)),
                cv::Mat(size, CV_8UC1, cv::Scalar(0))};
  for (const Body& body : tracer.bodies()) {
    const Vec3 center = body.center();
    canvas.active(seen_rect(setting.camera, center, body.model->radius(), size)).setTo(1);
    canvas.active(shadow_rect(setting.camera, setting.light.position, center, body.model->radius(), size))
        .setTo(1);
  }
  const auto rows = static_cast<std::size_t>(size.height);
  parallel_for(rows / 2, options_.threads, [&](std::size_t pair) {
    cast_once(tracer, setting.camera, canvas, 2 * static_cast<int>(pair));
  });
  canvas.once.copyTo(picture);
  parallel_for(rows, options_.threads, [&](std::size_t row) {
    refine_edges(tracer, setting.camera, canvas, picture, static_cast<int>(row));
  });
  return picture;
}

}  // namespace eigenpose::sim
