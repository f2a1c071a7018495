#include "sim/scene/tracer.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <embree3/rtcore.h>

#include "sim/scene/shading.h"
#include "sim/scene/stage.h"

namespace eigenpose::sim {
namespace {

constexpr float pi = std::numbers::pi_v<float>;
constexpr float lamp_strength = 1.12F;     // puts a white sheet on the table near full scale
constexpr float clear_of_surface = 0.25F;  // mm a shadow ray starts above its surface
// Black velvet, as labs lay under their objects: what stands out of it is an object.
constexpr Vec3 felt{0.0029F, 0.0029F, 0.0031F};
constexpr Vec3 backdrop{0.0030F, 0.0030F, 0.0032F};
constexpr Vec3 rim{0.0036F, 0.0036F, 0.0038F};

float radians_of(float degrees_value) {
  return degrees_value * pi / 180.0F;
}

/// Does the segment pass through the sphere?
bool passes(Vec3 origin, Vec3 direction, float reach, Vec3 center, float radius) {
  const Vec3 to_center = center - origin;
  const float along = std::clamp(dot(to_center, direction), 0.0F, reach);
  const Vec3 off = to_center - along * direction;
  return dot(off, off) <= radius * radius;
}

}  // namespace

Light light_of(const SceneState& scene) {
  const float azimuth = radians_of(static_cast<float>(scene.light_azimuth_deg) + stage::lamp_zero_deg);
  const float elevation = radians_of(static_cast<float>(scene.light_elevation_deg));
  const Vec3 direction{std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                       std::sin(elevation)};
  return {stage::lamp_aim + stage::lamp_distance_mm * direction, static_cast<float>(scene.lamp_level)};
}

Pinhole::Pinhole(int width, int height)
    : focal_(static_cast<float>(width) * stage::camera_distance_mm / stage::field_width_mm),
      cx_(0.5F * static_cast<float>(width)),
      cy_(0.5F * static_cast<float>(height)) {
  const float elevation = radians_of(stage::camera_elevation_deg);
  const Vec3 back{0.0F, -std::cos(elevation), std::sin(elevation)};
  position_ = stage::camera_target + stage::camera_distance_mm * back;
  forward_ = -back;
  right_ = {1.0F, 0.0F, 0.0F};
  up_ = cross(right_, forward_);
}

Vec3 Pinhole::direction(float x, float y) const {
  return normalized(focal_ * forward_ + (x - cx_) * right_ + (cy_ - y) * up_);
}

void Pinhole::project(Vec3 point, float& x, float& y) const {
  const Vec3 d = point - position_;
  const float scale = focal_ / std::max(dot(d, forward_), 1.0F);
  x = cx_ + scale * dot(d, right_);
  y = cy_ - scale * dot(d, up_);
}

float Pinhole::pixels_per_mm(Vec3 point) const {
  return focal_ / std::max(dot(point - position_, forward_), 1.0F);
}

Body::Body(std::shared_ptr<const Model> what, float angle, Vec3 where)
    : model(std::move(what)), cosine(std::cos(angle)), sine(std::sin(angle)), offset(where) {
  middle = direction_to_world(model->center()) + offset;
}

std::vector<Body> bodies_of(const SceneState& scene) {
  std::vector<Body> bodies;
  for (const PosedObject& object : scene.objects) {
    auto model = model_of(object.name);
    if (!model) continue;
    const float angle = radians_of(static_cast<float>(object.angle_deg));
    bodies.emplace_back(std::move(model), angle,
                        Vec3{static_cast<float>(object.x_mm), static_cast<float>(object.y_mm),
                             static_cast<float>(object.z_mm)});
  }
  if (scene.hand) {
    const Vec3 offset = stage::hand_offset(static_cast<float>(*scene.hand)) + stage::hand_rest;
    const float angle = radians_of(stage::hand_angle_deg);
    bodies.emplace_back(hand_model(), angle, offset);
  }
  return bodies;
}

struct Tracer::Rays {
  std::array<Vec3, 4> origin;
  std::array<Vec3, 4> direction;
};

struct Tracer::Surface {
  Vec3 point;
  Vec3 normal;
  Vec3 to_viewer;
  Vec3 to_light;
  Paint paint;
  float openness = 1.0F;
  int what = -1;
  bool faces_lamp = false;
};

struct Tracer::Hit {
  int body = -1;
  unsigned triangle = 0;
  float u = 0.0F;
  float v = 0.0F;
  float distance = std::numeric_limits<float>::infinity();
};

Tracer::Tracer(const Pinhole& camera, Light light, std::vector<Body> bodies, int bounce_rays)
    : camera_(camera), light_(light), bodies_(std::move(bodies)), bounce_rays_(bounce_rays) {
  // Four points of the lamp's disc, each standing for a quarter of its area.
  lamp_axis_ = normalized(stage::lamp_aim - light_.position);
  const Vec3 axis = lamp_axis_;
  const Vec3 side = normalized(cross(axis, std::abs(axis.z) < 0.95F ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
  const Vec3 other = cross(axis, side);
  for (std::size_t i = 0; i < 4; ++i) {
    const float angle = 0.5F * pi * static_cast<float>(i) + 0.4F;
    const float r = 0.7F * stage::lamp_radius_mm;
    lamp_points_[i] = light_.position + (r * std::cos(angle)) * side + (r * std::sin(angle)) * other;
  }
}

void Tracer::intersect(const Rays& rays, std::array<Hit, 4>& hits) const {
  alignas(16) const std::array<int, 4> valid{-1, -1, -1, -1};
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Body& body = bodies_[b];
    const Vec3 center = body.middle;
    bool near = false;
    for (std::size_t k = 0; k < 4 && !near; ++k) {
      near = passes(rays.origin[k], rays.direction[k], 1e5F, center, body.model->radius());
    }
    if (!near) continue;
    alignas(16) RTCRayHit4 packet{};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 o = body.to_local(rays.origin[k]);
      const Vec3 d = body.direction_to_local(rays.direction[k]);
      packet.ray.org_x[k] = o.x;
      packet.ray.org_y[k] = o.y;
      packet.ray.org_z[k] = o.z;
      packet.ray.dir_x[k] = d.x;
      packet.ray.dir_y[k] = d.y;
      packet.ray.dir_z[k] = d.z;
      packet.ray.tfar[k] = hits[k].distance;
      packet.ray.mask[k] = 0xFFFFFFFFU;
      packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect4(valid.data(), body.model->scene(), &context, &packet);
    for (std::size_t k = 0; k < 4; ++k) {
      if (packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
      hits[k] = {static_cast<int>(b), packet.hit.primID[k], packet.hit.u[k], packet.hit.v[k],
                 packet.ray.tfar[k]};
    }
  }
}

Vec3 Tracer::lamp_irradiance(Vec3 point) const {
  const Vec3 d = point - light_.position;
  const float squared = dot(d, d);
  const float cosine = dot(d, lamp_axis_) / std::sqrt(squared);
  const float beam = smooth_step(0.80F, 0.95F, cosine);
  const float strength =
      light_.level * lamp_strength * beam * stage::lamp_distance_mm * stage::lamp_distance_mm / squared;
  return strength * Vec3{1.0F, 0.965F, 0.91F};
}

std::array<bool, 4> Tracer::blocked(const std::array<Vec3, 4>& from, std::array<bool, 4> wanted) const {
  alignas(16) std::array<int, 4> valid{};
  for (std::size_t k = 0; k < 4; ++k) valid[k] = wanted[k] ? -1 : 0;
  std::array<bool, 4> result{};
  for (const Body& body : bodies_) {
    bool near = false;
    for (std::size_t k = 0; k < 4 && !near; ++k) {
      const Vec3 way = lamp_points_[k] - from[k];
      const float reach = length(way);
      near = valid[k] != 0 && passes(from[k], (1.0F / reach) * way, reach, body.middle, body.model->radius());
    }
    if (!near) continue;
    alignas(16) RTCRay4 packet{};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 o = body.to_local(from[k]);
      const Vec3 d = body.direction_to_local(lamp_points_[k] - from[k]);
      packet.org_x[k] = o.x;
      packet.org_y[k] = o.y;
      packet.org_z[k] = o.z;
      packet.dir_x[k] = d.x;
      packet.dir_y[k] = d.y;
      packet.dir_z[k] = d.z;
      packet.tfar[k] = 1.0F;
      packet.mask[k] = 0xFFFFFFFFU;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded4(valid.data(), body.model->scene(), &context, &packet);
    for (std::size_t k = 0; k < 4; ++k) {
      if (valid[k] == 0 || packet.tfar[k] >= 0.0F) continue;
      valid[k] = 0;
      result[k] = true;
    }
  }
  return result;
}

float Tracer::lamp_visible(Vec3 point) const {
  float open = 0.0F;
  for (const bool dark : blocked({point, point, point, point}, {true, true, true, true}))
    open += dark ? 0.0F : 0.25F;
  return open;
}

StagePoint stage_point(Vec3 camera, Vec3 direction) {
  const auto at = [&](float t) { return camera + t * direction; };
  const auto edge = static_cast<float>(stage::table_radius_mm);
  const Vec3 top = at(-camera.z / direction.z);
  const float r = std::sqrt(top.x * top.x + top.y * top.y);
  const Vec3 up{0.0F, 0.0F, 1.0F};
  if (r <= edge) {
    if (r > edge - 2.5F) return {top, up, rim};
    // Fine rings help to centre an object.
    const bool ring = std::abs(std::remainder(r, 25.0F)) < 0.35F && r > 12.0F;
    return {top, up, ring ? 1.15F * felt : felt};
  }
  // The table's side, or past it the backdrop below.
  const float a = direction.x * direction.x + direction.y * direction.y;
  const float b = camera.x * direction.x + camera.y * direction.y;
  const float c = camera.x * camera.x + camera.y * camera.y - edge * edge;
  const float discriminant = b * b - a * c;
  if (discriminant > 0.0F) {
    const Vec3 side = at((-b - std::sqrt(discriminant)) / a);
    if (side.z <= 0.0F && side.z >= -stage::table_height_mm)
      return {side, normalized({side.x, side.y, 0.0F}), rim};
  }
  return {at((-stage::table_height_mm - camera.z) / direction.z), up, backdrop};
}

float Tracer::lit(const StagePoint& place) const {
  return lamp_visible(place.point + clear_of_surface * place.normal);
}

Vec3 Tracer::stage_in_room(const StagePoint& place) const {
  return place.albedo * room_irradiance(place.normal);
}

Vec3 Tracer::stage_in_lamp(const StagePoint& place) const {
  const float nl = dot(place.normal, normalized(light_.position - place.point));
  return std::max(nl, 0.0F) * (place.albedo * lamp_irradiance(place.point));
}

Tracer::Surface Tracer::surface_at(const Hit& hit, Vec3 origin, Vec3 direction) const {
  const Body& body = bodies_[static_cast<std::size_t>(hit.body)];
  const Mesh& mesh = body.model->mesh();
  const std::uint32_t* corner = &mesh.triangles[3 * static_cast<std::size_t>(hit.triangle)];
  const float w = 1.0F - hit.u - hit.v;
  const Vec3 local_normal = normalized(w * mesh.normals[corner[0]] + hit.u * mesh.normals[corner[1]] +
                                       hit.v * mesh.normals[corner[2]]);
  Surface surface;
  surface.openness =
      w * mesh.openness[corner[0]] + hit.u * mesh.openness[corner[1]] + hit.v * mesh.openness[corner[2]];
  surface.point = origin + hit.distance * direction;
  const Vec3 local = body.to_local(surface.point);
  int part = mesh.parts[corner[0]];
  if (part != mesh.parts[corner[1]] || part != mesh.parts[corner[2]])
    part = body.model->shape().field(local).part;
  surface.what = 64 * hit.body + part;
  surface.paint = body.model->shape().paint(local, local_normal, part);
  surface.to_viewer = -direction;
  surface.normal = body.direction_to_world(local_normal);
  // An interpolated normal may look away from the viewer at the outline.
  const float away = dot(surface.normal, surface.to_viewer);
  if (away < 0.0F) surface.normal = normalized(surface.normal - (1.01F * away) * surface.to_viewer);
  surface.to_light = normalized(light_.position - surface.point);
  surface.faces_lamp = light_.level > 0.0F && dot(surface.normal, surface.to_light) > 0.0F;
  return surface;
}

Vec3 Tracer::shaded(const Surface& surface, float lamp_share, bool with_bounce) const {
  Vec3 colour = reflected_room(surface.paint, surface.normal, surface.to_viewer, surface.openness);
  if (surface.faces_lamp && lamp_share > 0.0F) {
    colour += reflected(surface.paint, surface.normal, surface.to_light, surface.to_viewer,
                        lamp_share * lamp_irradiance(surface.point));
  }
  if (with_bounce) {
    colour += (1.0F - surface.paint.metal) * (surface.paint.albedo * bounced(surface.point, surface.normal));
  }
  return colour;
}

// Four neighbours first look at one point of the lamp each. Where they agree, none is in a half shadow; where
// they don't, each looks at all four points.
std::array<Sample, 4> Tracer::shaded_hits(const Rays& rays, const std::array<Hit, 4>& hits,
                                          bool with_bounce) const {
  std::array<Surface, 4> surfaces;
  std::array<Vec3, 4> above;
  std::array<bool, 4> wanted{};
  for (std::size_t k = 0; k < 4; ++k) {
    if (hits[k].body < 0) continue;
    surfaces[k] = surface_at(hits[k], rays.origin[k], rays.direction[k]);
    above[k] = surfaces[k].point + clear_of_surface * surfaces[k].normal;
    wanted[k] = surfaces[k].faces_lamp;
  }
  const std::array<bool, 4> dark = blocked(above, wanted);
  bool any_dark = false;
  bool any_lit = false;
  for (std::size_t k = 0; k < 4; ++k) {
    any_dark = any_dark || (wanted[k] && dark[k]);
    any_lit = any_lit || (wanted[k] && !dark[k]);
  }
  std::array<Sample, 4> samples;
  for (std::size_t k = 0; k < 4; ++k) {
    if (hits[k].body < 0) continue;
    const float share = any_dark && any_lit && wanted[k] ? lamp_visible(above[k]) : (any_lit ? 1.0F : 0.0F);
    samples[k] = {shaded(surfaces[k], share, with_bounce), surfaces[k].what};
  }
  return samples;
}

Vec3 Tracer::bounced(Vec3 point, Vec3 normal) const {
  const Vec3 t = normalized(cross(std::abs(normal.z) < 0.9F ? Vec3{0, 0, 1} : Vec3{1, 0, 0}, normal));
  const Vec3 b = cross(normal, t);
  const Vec3 origin = point + clear_of_surface * normal;
  Vec3 sum;
  for (int i = 0; i + 4 <= bounce_rays_; i += 4) {
    Rays rays;
    std::array<Hit, 4> hits;
    for (int k = 0; k < 4; ++k) {
      const float u = (static_cast<float>(i + k) + 0.5F) / static_cast<float>(bounce_rays_);
      const float angle = static_cast<float>(i + k) * 2.399963F;
      const float r = std::sqrt(u);
      rays.origin[k] = origin;
      rays.direction[k] =
          (r * std::cos(angle)) * t + (r * std::sin(angle)) * b + std::sqrt(1.0F - u) * normal;
    }
    intersect(rays, hits);
    for (const Sample& sample : shaded_hits(rays, hits, false)) sum += sample.colour;
  }
  return (1.0F / static_cast<float>(bounce_rays_)) * sum;
}

std::array<Sample, 4> Tracer::sample(const std::array<Vec3, 4>& directions) const {
  Rays rays;
  std::array<Hit, 4> hits;
  for (std::size_t k = 0; k < 4; ++k) {
    rays.origin[k] = camera_.position();
    rays.direction[k] = directions[k];
  }
  intersect(rays, hits);
  return shaded_hits(rays, hits, bounce_rays_ > 0);
}

}  // namespace eigenpose::sim
