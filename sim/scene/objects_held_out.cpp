#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

// Rocket ----------------------------------------------------------------------------------------------------

enum RocketPart { rocket_hull, rocket_fin, rocket_window, rocket_nose };

Field rocket_field(Vec3 p) {
  Field f{ellipsoid(p - Vec3{0, 0, 52}, {19.0F, 19.0F, 52.0F}), rocket_hull};
  f = {std::max(f.distance, 10.0F - p.z), f.part};
  f = join(f, cone_z(p, 4.0F, 11.0F, 12.0F, 8.0F), rocket_nose);
  for (int i = 0; i < 3; ++i) {
    const Vec3 q = turn_z(p, 120.0F * static_cast<float>(i) + 20.0F);
    const float outline = std::max({q.x + 0.62F * q.z - 48.0F, 6.0F - q.x, -q.z + 0.3F, q.x - 36.0F});
    f = blend(f, 0.8F * std::max(outline, std::abs(q.y) - 2.2F), rocket_fin, 2.0F);
  }
  return join(f, torus_y(p - Vec3{0, -17, 62}, 7.5F, 2.2F), rocket_window);
}

Paint rocket_paint(Vec3 p, Vec3, int part) {
  if (part == rocket_fin) return {srgb(0xC83A32), 0.05F, 0.2F, 0.0F};
  if (part == rocket_window) return {srgb(0xC9C9CD), 0.6F, 0.2F, 1.0F};
  if (part == rocket_nose) return {srgb(0x6A6A70), 0.5F, 0.3F, 1.0F};
  if (p.y < 0.0F && std::hypot(p.x, p.z - 62.0F) < 7.5F) return {srgb(0x2E4E74), 0.08F, 0.06F, 0.0F};
  if (p.z > 84.0F) return {srgb(0xC83A32), 0.05F, 0.2F, 0.0F};
  const bool checker =
      p.z > 24.0F && p.z < 38.0F && (std::sin(6.0F * std::atan2(p.y, p.x)) > 0.0F) == (p.z > 31.0F);
  return {checker ? srgb(0x2C2C30) : srgb(0xE8E4DA), 0.05F, 0.2F, 0.0F};
}

// Snail, creeps towards −x ----------------------------------------------------------------------------------

enum SnailPart { snail_body, snail_shell, snail_eye };

Field snail_field(Vec3 p) {
  const Vec3 m{p.x, std::abs(p.y), p.z};
  Field f{capsule(p, {-36, 0, 10}, {44, 0, 5}, 11.0F, 4.0F), snail_body};
  f = blend(f, capsule(p, {-36, 0, 10}, {-44, 0, 34}, 9.0F, 9.0F), snail_body, 8.0F);
  f = join(f, capsule(m, {-46, 4, 40}, {-54, 10, 56}, 2.0F), snail_body);
  f = join(f, sphere(m - Vec3{-54, 10, 57}, 3.4F), snail_eye);
  f = join(f, cylinder_y(p - Vec3{4, 0, 38}, 31.0F, 15.0F, 13.0F), snail_shell);
  return {std::max(f.distance, 0.3F - p.z), f.part};
}

Paint snail_paint(Vec3 p, Vec3, int part) {
  if (part == snail_eye) return {srgb(0x26262A), 0.06F, 0.1F, 0.0F};
  if (part == snail_shell) {
    const float x = p.x - 4.0F;
    const float z = p.z - 38.0F;
    const float turn = std::hypot(x, z) / 11.0F - std::atan2(z, x) / 6.2831853F;
    const bool stripe = turn - std::floor(turn) < 0.35F;
    return {stripe ? srgb(0x6E3B1E) : srgb(0xD9A860), 0.05F, 0.2F, 0.0F};
  }
  return {mix(srgb(0x9AA35E), srgb(0x7C8446), cloud_noise(0.12F * p, 3)), 0.05F, 0.3F, 0.0F};
}

// Kettle bell
// -------------------------------------------------------------------------------------------------

enum BellPart { bell_ball, bell_grip, bell_plate };

Field bell_field(Vec3 p) {
  Field f{sphere(p - Vec3{0, 0, 30}, 31.0F), bell_ball};
  const Vec3 q = p - Vec3{0, 0, 62};
  f = blend(f, torus_y({0.8F * q.x, q.y, q.z}, 19.0F, 5.5F), bell_grip, 6.0F);
  f = join(f, cylinder_y(p - Vec3{0, -27, 30}, 17.0F, 4.0F, 1.0F), bell_plate);
  return {std::max(f.distance, 2.0F - p.z), f.part};
}

Paint bell_paint(Vec3 p, Vec3, int part) {
  if (part == bell_plate) {
    const bool ink = glyph('1', (p.x + 6.0F) / 11.0F, (p.z - 30.0F) / 13.0F) < 0.12F ||
                     glyph('2', (p.x - 6.0F) / 11.0F, (p.z - 30.0F) / 13.0F) < 0.12F;
    return {ink ? srgb(0xF0ECE0) : srgb(0x8A2F6B), 0.05F, 0.3F, 0.0F};
  }
  if (part == bell_grip) return {srgb(0xB4B4BA), 0.6F, 0.3F, 1.0F};
  return {mix(srgb(0x6B5A8C), srgb(0x54457A), cloud_noise(0.2F * p, 3)), 0.05F, 0.45F, 0.0F};
}

// Locomotive, towards −x
// ----------------------------------------------------------------------------------------

enum LocoPart { loco_boiler, loco_cab, loco_wheel, loco_frame, loco_brass, loco_chimney };

Field loco_field(Vec3 p) {
  const Vec3 m{p.x, std::abs(p.y), p.z};
  Field f{cylinder_x(p - Vec3{-14, 0, 34}, 17.0F, 36.0F, 2.0F), loco_boiler};
  f = join(f, box(p - Vec3{0, 0, 15}, {52.0F, 17.0F, 5.0F}, 1.0F), loco_frame);
  f = join(f, box(p - Vec3{34, 0, 38}, {16.0F, 20.0F, 22.0F}, 2.0F), loco_cab);
  f = join(f, box(p - Vec3{34, 0, 61}, {20.0F, 23.0F, 2.5F}, 1.5F), loco_frame);
  f = join(f, cone_z(p - Vec3{-38, 0, 0}, 46.0F, 6.0F, 70.0F, 9.0F), loco_chimney);
  f = join(f, ellipsoid(p - Vec3{-8, 0, 52}, {8.0F, 8.0F, 10.0F}), loco_brass);
  for (const float x : {-34.0F, -6.0F, 30.0F}) {
    f = join(f, cylinder_y(m - Vec3{x, 19, 12}, x > 20.0F ? 12.0F : 10.0F, 3.0F, 1.0F), loco_wheel);
  }
  return join(f, cylinder_x(p - Vec3{-51, 0, 34}, 7.0F, 3.0F, 1.0F), loco_brass);
}

Paint loco_paint(Vec3 p, Vec3 n, int part) {
  switch (part) {
    case loco_wheel: {
      const float spoke = std::atan2(p.z - 12.0F, p.x);
      return {std::sin(8.0F * spoke) > 0.3F ? srgb(0xC2322C) : srgb(0x7E2420), 0.05F, 0.3F, 0.0F};
    }
    case loco_frame:
      return {srgb(0x4C4C52), 0.05F, 0.4F, 0.0F};
    case loco_brass:
      return {srgb(0xD8B04A), 0.6F, 0.2F, 1.0F};
    case loco_chimney:
      return {srgb(0x3A3A3E), 0.05F, 0.4F, 0.0F};
    case loco_cab:
      if (std::abs(n.y) > 0.7F && std::abs(p.x - 34.0F) < 8.0F && std::abs(p.z - 46.0F) < 7.0F) {
        return {srgb(0x30404C), 0.08F, 0.08F, 0.0F};
      }
      return {srgb(0x1F5C50), 0.05F, 0.25F, 0.0F};
    default:
      break;
  }
  const bool band = std::abs(std::remainder(p.x + 14.0F, 18.0F)) < 1.4F;
  return {band ? srgb(0xD8B04A) : srgb(0x26705F), 0.05F, 0.2F, 0.0F};
}

}  // namespace

Shape rocket() {
  return {rocket_field, rocket_paint, {-37, -37, 0}, {37, 37, 105}, 1.3F};
}
Shape snail() {
  return {snail_field, snail_paint, {-59, -17, 0}, {49, 17, 70}, 1.3F};
}
Shape kettle_bell() {
  return {bell_field, bell_paint, {-32, -33, 0}, {32, 32, 88}, 1.5F};
}
Shape locomotive() {
  return {loco_field, loco_paint, {-56, -25, 0}, {55, 25, 72}, 1.3F};
}

}  // namespace eigenpose::sim::objects
