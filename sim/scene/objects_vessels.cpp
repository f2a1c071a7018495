#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

// Mug ---------------------------------------------------------------------------------------------------

enum MugPart { mug_outside, mug_handle, mug_inside };

Field mug_field(Vec3 p) {
  Field f{cylinder_z(p - Vec3{0, 0, 43}, 35.0F, 43.0F, 3.0F), mug_outside};
  const Vec3 q = p - Vec3{37, 0, 45};
  f = blend(f, torus_y({q.x, q.y, 0.84F * q.z}, 20.0F, 4.8F), mug_handle, 5.0F);
  return cut(f, cylinder_z(p - Vec3{0, 0, 50}, 31.8F, 44.0F, 5.0F), mug_inside);
}

Paint mug_paint(Vec3 p, int part, Vec3 glaze, Vec3 dark) {
  Paint paint{glaze, 0.045F, 0.12F, 0.0F};
  if (part == mug_inside) {
    paint.albedo = srgb(0xF2ECDD);
    return paint;
  }
  if (part == mug_handle) return paint;
  // A sailing boat in a white disc on the front, waves around the foot.
  const float x = p.x;
  const float z = p.z - 47.0F;
  if (p.y < 0.0F && std::hypot(x, z) < 22.0F) {
    paint.albedo = srgb(0xF4F1E8);
    const bool sail = x > -1.5F && z > -6.0F && x + 0.75F * z < 11.0F;
    const bool jib = x < -3.0F && z > -6.0F && -x + 0.9F * z < 12.0F;
    const bool hull = z < -8.0F && z > -14.0F && std::abs(x) < 16.0F + 0.6F * (z + 8.0F);
    if (sail) paint.albedo = dark;
    if (jib) paint.albedo = srgb(0xE8B23A);
    if (hull) paint.albedo = srgb(0x5A3A28);
  } else {
    const float angle = std::atan2(p.y, p.x);
    const float wave = 12.0F + 2.6F * std::sin(9.0F * angle);
    if (std::abs(p.z - wave) < 2.2F) paint.albedo = srgb(0xF4F1E8);
    // Three dots at the back, left of the handle.
    for (int i = 0; i < 3; ++i) {
      const float at = 1.15F + 0.45F * static_cast<float>(i);
      if (std::hypot(35.0F * (angle - at), p.z - 60.0F + 7.0F * static_cast<float>(i)) < 5.0F) {
        paint.albedo = srgb(0xF4F1E8);
      }
    }
  }
  return paint;
}

Paint mug_red_paint(Vec3 p, Vec3, int part) {
  return mug_paint(p, part, srgb(0xB3262B), srgb(0x8E1D22));
}
Paint mug_blue_paint(Vec3 p, Vec3, int part) {
  return mug_paint(p, part, srgb(0x2456A8), srgb(0x1C4486));
}

// Bottle: nothing about it depends on the angle -------------------------------------------------------------

enum BottlePart { bottle_glass, bottle_cap };

Field bottle_field(Vec3 p) {
  Field f{cylinder_z(p - Vec3{0, 0, 32}, 25.0F, 32.0F, 4.0F), bottle_glass};
  f = blend(f, cone_z(p, 56.0F, 23.0F, 82.0F, 9.0F), bottle_glass, 8.0F);
  f = blend(f, cylinder_z(p - Vec3{0, 0, 86}, 9.0F, 14.0F, 1.0F), bottle_glass, 5.0F);
  return join(f, cylinder_z(p - Vec3{0, 0, 100}, 11.0F, 6.0F, 1.5F), bottle_cap);
}

Paint bottle_paint(Vec3 p, Vec3, int part) {
  if (part == bottle_cap) return {srgb(0xC9A227), 0.6F, 0.25F, 1.0F};
  if (p.z > 16.0F && p.z < 50.0F) {
    const bool line = std::abs(p.z - 19.5F) < 1.0F || std::abs(p.z - 46.5F) < 1.0F;
    const bool band = p.z > 29.0F && p.z < 37.0F;
    return {line ? srgb(0x7A1F1F) : band ? srgb(0x2F6B3A) : srgb(0xE9DFC4), 0.03F, 0.6F, 0.0F};
  }
  return {srgb(0x2C5A34), 0.06F, 0.08F, 0.0F};
}

// Teapot -------------------------------------------------------------------------------------------------

enum TeapotPart { teapot_body, teapot_spout, teapot_handle, teapot_lid, teapot_knob };

Field teapot_field(Vec3 p) {
  Field f{ellipsoid(p - Vec3{0, 0, 31}, {38.0F, 38.0F, 31.0F}), teapot_body};
  f = {std::max(f.distance, 2.0F - p.z), teapot_body};
  f = join(f, cylinder_z(p - Vec3{0, 0, 3}, 22.0F, 3.0F, 1.0F), teapot_body);
  const float spout = std::min(capsule(p, {-32, 0, 22}, {-52, 0, 42}, 9.0F, 6.0F),
                               capsule(p, {-52, 0, 42}, {-60, 0, 58}, 6.0F, 4.5F));
  f = blend(f, spout, teapot_spout, 6.0F);
  f = cut(f, capsule(p, {-58.5F, 0, 54}, {-64, 0, 68}, 2.8F));
  const Vec3 q = p - Vec3{39, 0, 35};
  f = blend(f, torus_y({q.x, q.y, q.z}, 17.0F, 4.2F), teapot_handle, 3.0F);
  f = join(f, ellipsoid(p - Vec3{0, 0, 56}, {22.0F, 22.0F, 9.0F}), teapot_lid);
  return join(f, sphere(p - Vec3{0, 0, 69}, 6.0F), teapot_knob);
}

Paint teapot_paint(Vec3 p, Vec3, int part) {
  Paint paint{srgb(0xE6E2D8), 0.05F, 0.1F, 0.0F};
  const Vec3 ink = srgb(0x274F86);
  if (part == teapot_spout || part == teapot_knob) paint.albedo = ink;
  if (part == teapot_lid) {
    const float angle = std::atan2(p.y, p.x);
    if (std::sin(8.0F * angle) > 0.35F && std::hypot(p.x, p.y) > 9.0F) paint.albedo = ink;
  }
  if (part == teapot_body) {
    // A large flower on the front, a small one on the back, a rim of leaves.
    const float side = p.y < 0.0F ? 1.0F : 0.62F;
    const float x = (p.x + (p.y < 0.0F ? 4.0F : -10.0F)) / side;
    const float z = (p.z - 31.0F) / side;
    const float r = std::hypot(x, z);
    const float petals = 12.0F + 6.0F * std::cos(5.0F * std::atan2(z, x));
    if (r < petals) paint.albedo = r < 4.5F ? srgb(0xD99A2B) : (p.y < 0.0F ? ink : srgb(0xB23A48));
    const float angle = std::atan2(p.y, p.x);
    if (p.z > 47.0F && p.z < 51.0F && std::sin(14.0F * angle) > -0.2F) paint.albedo = srgb(0x3E7A4B);
    if (p.z < 10.0F && p.z > 7.0F) paint.albedo = ink;
  }
  return paint;
}

}  // namespace

Shape mug_red() {
  return {mug_field, mug_red_paint, {-36, -36, 0}, {63, 36, 86}, 1.6F};
}
Shape mug_blue() {
  return {mug_field, mug_blue_paint, {-36, -36, 0}, {63, 36, 86}, 1.6F};
}
Shape bottle() {
  return {bottle_field, bottle_paint, {-26, -26, 0}, {26, 26, 107}, 1.3F};
}
Shape teapot() {
  return {teapot_field, teapot_paint, {-66, -39, 0}, {61, 39, 76}, 1.5F};
}

}  // namespace eigenpose::sim::objects
