#include "sim/scene/renderer.h"

#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "core/base/parallel.h"
#include "sim/scene/stage.h"

namespace eigenpose::sim {
namespace {

/// Two neighbours that differ more than this (relative to their brightness) get four rays.
constexpr float contrast_for_more_rays = 0.12F;
/// A highlight counts as much as the sensor can hold, or it would glare over its edge.
constexpr float brightest = 1.5F;

// What is cast for a pixel.
constexpr std::uint8_t may_hit_body = 1;
constexpr std::uint8_t may_be_shadowed = 2;

cv::Vec3f as_pixel(Vec3 colour) {
  return {colour.z, colour.y, colour.x};
}  // OpenCV keeps blue first

/// The smallest rectangle around the pixels in which points are seen, cut to the picture and widened to even
/// coordinates. Empty when all points lie outside the picture.
class SeenRect {
 public:
  SeenRect(const Pinhole& camera, cv::Size size) : camera_(camera), size_(size) {}
  void include(Vec3 point) {
    float x = 0.0F;
    float y = 0.0F;
    camera_.project(point, x, y);
    left_ = std::min(left_, x);
    right_ = std::max(right_, x);
    top_ = std::min(top_, y);
    bottom_ = std::max(bottom_, y);
  }
  [[nodiscard]] cv::Rect rect() const {
    constexpr float margin = 2.0F;
    const auto even = [](float v, int limit) {
      return static_cast<int>(std::clamp(std::floor(v), 0.0F, static_cast<float>(limit))) & ~1;
    };
    const int x = even(left_ - margin, size_.width);
    const int y = even(top_ - margin, size_.height);
    const int width = even(right_ + margin + 2.0F, size_.width) - x;
    const int height = even(bottom_ + margin + 2.0F, size_.height) - y;
    if (width <= 0 || height <= 0) return {};
    return {x, y, width, height};
  }

 private:
  const Pinhole& camera_;
  cv::Size size_;
  float left_ = 1e9F;
  float top_ = 1e9F;
  float right_ = -1e9F;
  float bottom_ = -1e9F;
};

/// Where the lamp throws a point, on table or backdrop.
Vec3 shadow_of(Vec3 point, Vec3 lamp, float floor_z) {
  Vec3 way = point - lamp;
  // A lamp near the table's plane throws shadows without end; far outside of the picture is far enough.
  way.z = std::min(way.z, -0.02F * length(way));
  return point + std::max(0.0F, (floor_z - point.z) / way.z) * way;
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

}  // namespace

struct Renderer::Stage {
  Light light;
  cv::Mat room;  ///< CV_32FC3: what the room alone shows
  cv::Mat lamp;  ///< CV_32FC3: what the lamp adds where nothing shadows it
  cv::Mat both;
};

struct Renderer::Canvas {
  cv::Mat once;    ///< CV_32FC3: one ray a pixel
  cv::Mat what;    ///< CV_32SC1: Sample::what
  cv::Mat active;  ///< CV_8UC1: may_hit_body, may_be_shadowed

  Canvas(const Renderer::Stage& stage, const Pinhole& camera, const Light& light, const Tracer& tracer) {
    draw_on(stage, camera, light, tracer);
  }
  void draw_on(const Renderer::Stage& stage, const Pinhole& camera, const Light& light, const Tracer& tracer);
  void mark(const cv::Rect& rect, std::uint8_t cast);
  void cast_once(const Renderer::Stage& stage, const Pinhole& camera, const Tracer& tracer, int row);
  void refine_edges(const Renderer::Stage& stage, const Pinhole& camera, const Tracer& tracer,
                    cv::Mat& picture, int y) const;
};

void Renderer::Canvas::draw_on(const Renderer::Stage& stage, const Pinhole& camera, const Light& light,
                               const Tracer& tracer) {
  const cv::Size size = stage.both.size();
  stage.both.copyTo(once);
  what.create(size, CV_32SC1);
  what.setTo(-1);
  active.create(size, CV_8UC1);
  active.setTo(0);
  for (const Body& body : tracer.bodies()) {
    SeenRect seen(camera, size);
    SeenRect shadow(camera, size);
    for (const Vec3 local : body.model->outline()) {
      const Vec3 point = body.direction_to_world(local) + body.offset;
      seen.include(point);
      shadow.include(shadow_of(point, light.position, 0.0F));
      shadow.include(shadow_of(point, light.position, -stage::table_height_mm));
    }
    mark(seen.rect(), may_hit_body);
    mark(shadow.rect(), may_be_shadowed);
  }
}

// OpenCV refuses arithmetic on a matrix without pixels.
void Renderer::Canvas::mark(const cv::Rect& rect, std::uint8_t cast) {
  if (!rect.empty()) active(rect) |= cast;
}

// Two by two pixels at once. Where the table is seen, all of them share one look at the lamp: it is nearly
// black.
void Renderer::Canvas::cast_once(const Renderer::Stage& stage, const Pinhole& camera, const Tracer& tracer,
                                 int row) {
  for (int x = 0; x + 1 < once.cols; x += 2) {
    const std::uint8_t cast = active.at<std::uint8_t>(row, x);
    if (cast == 0) continue;
    std::array<Vec3, 4> directions;
    for (int k = 0; k < 4; ++k) {
      directions[static_cast<std::size_t>(k)] =
          camera.direction(static_cast<float>(x + (k & 1)) + 0.5F, static_cast<float>(row + (k >> 1)) + 0.5F);
    }
    std::array<Sample, 4> samples;
    if ((cast & may_hit_body) != 0) samples = tracer.sample(directions);
    std::optional<float> lit;
    for (int k = 0; k < 4; ++k) {
      const Sample& sample = samples[static_cast<std::size_t>(k)];
      const int px = x + (k & 1);
      const int py = row + (k >> 1);
      if (sample.what >= 0) {
        once.at<cv::Vec3f>(py, px) = as_pixel(sample.colour);
        what.at<int>(py, px) = sample.what;
      } else if ((cast & may_be_shadowed) != 0) {
        if (!lit) lit = tracer.lit(stage_point(camera.position(), directions[static_cast<std::size_t>(k)]));
        if (*lit < 1.0F) {
          once.at<cv::Vec3f>(py, px) =
              stage.room.at<cv::Vec3f>(py, px) + *lit * stage.lamp.at<cv::Vec3f>(py, px);
        }
      }
    }
  }
}

void Renderer::Canvas::refine_edges(const Renderer::Stage& stage, const Pinhole& camera, const Tracer& tracer,
                                    cv::Mat& picture, int y) const {
  constexpr std::array<std::array<float, 2>, 4> grid{
      {{0.375F, 0.125F}, {0.875F, 0.375F}, {0.125F, 0.625F}, {0.625F, 0.875F}}};
  for (int x = 0; x < picture.cols; ++x) {
    if ((active.at<std::uint8_t>(y, x) & may_hit_body) == 0) continue;
    const int here = what.at<int>(y, x);
    const cv::Vec3f& colour = once.at<cv::Vec3f>(y, x);
    const auto differs = [&](int nx, int ny) {
      if (nx < 0 || ny < 0 || nx >= picture.cols || ny >= picture.rows) return false;
      const int other = what.at<int>(ny, nx);
      if (here < 0 && other < 0) return false;  // shadows on the dark table need no care
      return here != other || contrasts(colour, once.at<cv::Vec3f>(ny, nx));
    };
    if (!differs(x - 1, y) && !differs(x + 1, y) && !differs(x, y - 1) && !differs(x, y + 1)) continue;
    std::array<Vec3, 4> directions;
    for (std::size_t k = 0; k < 4; ++k) {
      directions[k] =
          camera.direction(static_cast<float>(x) + grid[k][0], static_cast<float>(y) + grid[k][1]);
    }
    cv::Vec3f sum(0.0F, 0.0F, 0.0F);
    for (const Sample& sample : tracer.sample(directions)) {
      if (sample.what < 0) {
        sum += here < 0 ? colour
                        : stage.room.at<cv::Vec3f>(y, x);  // behind an outline lies its shadow, nearly always
        continue;
      }
      sum += as_pixel({std::min(sample.colour.x, brightest), std::min(sample.colour.y, brightest),
                       std::min(sample.colour.z, brightest)});
    }
    picture.at<cv::Vec3f>(y, x) = 0.25F * sum;
  }
}

Renderer::Renderer(RenderOptions options) : options_(options), camera_(options.width, options.height) {
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

void Renderer::light_stage(const Light& light) {
  if (stage_ && stage_->light == light) return;
  const cv::Size size(options_.width, options_.height);
  if (!stage_)
    stage_ = std::make_unique<Stage>(Stage{light, cv::Mat(size, CV_32FC3), cv::Mat(size, CV_32FC3), {}});
  stage_->light = light;
  const Tracer tracer(camera_, light, {}, 0);
  parallel_for(static_cast<std::size_t>(options_.height), options_.threads, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < options_.width; ++x) {
      const Vec3 direction = camera_.direction(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      const StagePoint place = stage_point(camera_.position(), direction);
      stage_->room.at<cv::Vec3f>(y, x) = as_pixel(tracer.stage_in_room(place));
      stage_->lamp.at<cv::Vec3f>(y, x) = as_pixel(tracer.stage_in_lamp(place));
    }
  });
  cv::add(stage_->room, stage_->lamp, stage_->both);
}

cv::Mat Renderer::render(const SceneState& scene, bool smooth) {
  const Light light = light_of(scene);
  light_stage(light);
  const Tracer tracer(camera_, light, bodies_of(scene), options_.bounce_rays);
  if (tracer.bodies().empty()) return stage_->both.clone();

  if (canvas_) {
    canvas_->draw_on(*stage_, camera_, light, tracer);
  } else {
    canvas_ = std::make_unique<Canvas>(*stage_, camera_, light, tracer);
  }
  const auto rows = static_cast<std::size_t>(options_.height);
  parallel_for(rows / 2, options_.threads, [&](std::size_t pair) {
    canvas_->cast_once(*stage_, camera_, tracer, 2 * static_cast<int>(pair));
  });
  cv::Mat picture = canvas_->once.clone();
  if (!smooth) return picture;
  parallel_for(rows, options_.threads, [&](std::size_t row) {
    canvas_->refine_edges(*stage_, camera_, tracer, picture, static_cast<int>(row));
  });
  return picture;
}

}  // namespace eigenpose::sim
