#include "sim/scene/shading.h"

#include <cmath>
#include <numbers>

namespace eigenpose::sim {
namespace {

constexpr Vec3 sky_colour{0.16F, 0.17F, 0.19F};
constexpr Vec3 floor_colour{0.015F, 0.015F, 0.016F};
constexpr Vec3 window_colour{1.5F, 1.55F, 1.65F};

/// 1 inside [−half, half], falling to 0 over `soft` beyond.
float slab(float x, float half, float soft) {
  return 1.0F - smooth_step(half, half + soft, std::abs(x));
}

Vec3 mirror_colour(const Paint& paint) {
  return mix(Vec3{paint.specular, paint.specular, paint.specular}, paint.albedo, paint.metal);
}

Vec3 fresnel(Vec3 f0, float cosine) {
  const float m = std::clamp(1.0F - cosine, 0.0F, 1.0F);
  const float m5 = m * m * m * m * m;
  return f0 + m5 * (Vec3{1.0F, 1.0F, 1.0F} - f0);
}

}  // namespace

Vec3 room_radiance(Vec3 direction, float roughness) {
  Vec3 light = mix(floor_colour, sky_colour, smooth_step(-0.25F, 0.7F, direction.z));
  // A window high on the right behind the camera, crossed by a bar.
  const Vec3 towards = normalized({0.55F, -0.62F, 0.56F});
  const Vec3 right = normalized(cross({0.0F, 0.0F, 1.0F}, towards));
  const Vec3 up = cross(towards, right);
  const float ahead = dot(direction, towards);
  if (ahead > 0.0F) {
    const float u = dot(direction, right) / ahead;
    const float v = dot(direction, up) / ahead;
    const float soft = 0.03F + 1.2F * roughness;
    float window = slab(u, 0.30F, soft) * slab(v, 0.38F, soft);
    if (roughness < 0.25F) window *= 1.0F - 0.8F * slab(u, 0.015F, 0.02F + 0.3F * roughness);
    light += (window / (1.0F + 6.0F * roughness)) * window_colour;
  }
  return light;
}

Vec3 room_irradiance(Vec3 normal) {
  const Vec3 towards = normalized({0.55F, -0.62F, 0.56F});
  const float facing = std::max(0.0F, 0.35F + 0.65F * dot(normal, towards));
  return mix(floor_colour, sky_colour, 0.5F + 0.5F * normal.z) + (0.05F * facing) * window_colour;
}

Vec3 reflected(const Paint& paint, Vec3 normal, Vec3 to_light, Vec3 to_viewer, Vec3 irradiance) {
  const float nl = dot(normal, to_light);
  if (nl <= 0.0F) return {};
  const float nv = std::max(dot(normal, to_viewer), 0.02F);
  const Vec3 half = normalized(to_light + to_viewer);
  const float nh = std::max(dot(normal, half), 0.0F);
  // A lamp of finite size never makes a sharper lobe than itself.
  const float alpha = std::max(paint.roughness * paint.roughness, 0.006F);
  const float a2 = alpha * alpha;
  const float spread = nh * nh * (a2 - 1.0F) + 1.0F;
  const float density = a2 / (spread * spread);  // times π, which `irradiance` is over
  const float k = 0.5F * alpha;
  const float masking = 1.0F / ((nl * (1.0F - k) + k) * (nv * (1.0F - k) + k));
  const Vec3 f = fresnel(mirror_colour(paint), dot(half, to_light));
  const float gloss = std::min(0.25F * density * masking, 60.0F);
  const Vec3 diffuse = (1.0F - paint.metal) * (paint.albedo * (Vec3{1.0F, 1.0F, 1.0F} - f));
  return nl * ((diffuse + gloss * f) * irradiance);
}

Vec3 reflected_room(const Paint& paint, Vec3 normal, Vec3 to_viewer, float openness) {
  const float nv = std::max(dot(normal, to_viewer), 0.0F);
  const Vec3 mirrored = (2.0F * dot(normal, to_viewer)) * normal - to_viewer;
  // Rough surfaces lose the grazing rise.
  const Vec3 f = (1.0F - 0.75F * paint.roughness) * fresnel(mirror_colour(paint), nv);
  const Vec3 diffuse = (1.0F - paint.metal) * paint.albedo;
  return openness * (diffuse * room_irradiance(normal) + f * room_radiance(mirrored, paint.roughness));
}

}  // namespace eigenpose::sim
