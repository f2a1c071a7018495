#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

// Car, drives towards −x ------------------------------------------------------------------------------------

enum CarPart { car_body, car_cabin, car_tyre, car_hub, car_lamp, car_bumper };

Field car_field(Vec3 p) {
  const Vec3 m{p.x, std::abs(p.y), p.z};
  Field f{box(p - Vec3{0, 0, 19}, {55.0F, 23.0F, 11.0F}, 5.0F), car_body};
  Vec3 q = p - Vec3{6, 0, 36};
  q.x += 0.32F * q.z * (q.x < 0.0F ? -1.0F : 0.7F);
  f = blend(f, 0.85F * box(q, {29.0F, 19.5F, 13.0F}, 5.0F), car_cabin, 3.0F);
  for (const float x : {-33.0F, 33.0F}) {
    f = cut(f, cylinder_y(m - Vec3{x, 24, 11}, 13.5F, 9.0F));
    f = join(f, cylinder_y(m - Vec3{x, 19.5F, 11}, 11.0F, 5.0F, 2.0F), car_tyre);
    f = join(f, cylinder_y(m - Vec3{x, 21.0F, 11}, 6.0F, 4.6F, 1.0F), car_hub);
  }
  f = join(f, sphere(m - Vec3{-53, 14, 22}, 4.6F), car_lamp);
  f = join(f, box(m - Vec3{-55, 0, 12}, {2.5F, 20.0F, 2.5F}, 1.0F), car_bumper);
  return join(f, box(m - Vec3{55, 0, 12}, {2.5F, 20.0F, 2.5F}, 1.0F), car_bumper);
}

Paint car_paint(Vec3 p, Vec3 n, int part) {
  switch (part) {
    case car_tyre:
      return {srgb(0x3A3A3C), 0.03F, 0.8F, 0.0F};
    case car_hub:
      return {srgb(0xC8C8CC), 0.6F, 0.25F, 1.0F};
    case car_lamp:
      return {srgb(0xF5EBC0), 0.06F, 0.08F, 0.0F};
    case car_bumper:
      return {srgb(0xB8B8BC), 0.6F, 0.2F, 1.0F};
    default:
      break;
  }
  const Vec3 green = srgb(0x2E7D4F);
  if (part == car_cabin && p.z > 31.0F && p.z < 44.0F) {
    const bool side = std::abs(n.y) > 0.6F;
    const bool pillar = side && (std::abs(p.x - 8.0F) < 2.0F || p.x < -15.0F || p.x > 28.0F);
    const bool frame = !side && std::abs(p.y) > 15.5F;
    if (!pillar && !frame) return {srgb(0x37474F), 0.08F, 0.06F, 0.0F};
  }
  Paint paint{green, 0.06F, 0.12F, 0.0F};
  // Two racing stripes over everything, a number on a white disc on the doors: 7 on the right, 4 on the left.
  if (n.z > 0.3F && std::abs(std::abs(p.y) - 5.0F) < 2.6F) paint.albedo = srgb(0xF1EEE4);
  if (std::abs(n.y) > 0.7F) {
    const float x = (p.y < 0.0F ? 1.0F : -1.0F) * (p.x - 2.0F);
    const float z = p.z - 19.0F;
    if (std::hypot(x, z) < 9.5F) {
      paint.albedo = srgb(0xF1EEE4);
      if (glyph(p.y < 0.0F ? '7' : '4', x / 9.0F, z / 9.0F) < 0.13F) paint.albedo = srgb(0x26262A);
    }
  }
  if (std::abs(n.x) > 0.7F && p.x > 0.0F && std::abs(std::abs(p.y) - 15.0F) < 4.0F && p.z > 18.0F &&
      p.z < 26.0F) {
    paint.albedo = srgb(0xC22A2A);
  }
  return paint;
}

// Photo camera, looks towards −y ----------------------------------------------------------------------------

enum PhotoPart { photo_body, photo_leather, photo_lens, photo_glass, photo_flash, photo_knob, photo_button };

Field photo_field(Vec3 p) {
  Field f{box(p - Vec3{0, 0, 33}, {46.0F, 15.0F, 29.0F}, 4.0F), photo_body};
  f = join(f, box(p - Vec3{0, 0, 29}, {46.6F, 15.6F, 16.0F}, 3.0F), photo_leather);
  f = blend(f, box(p - Vec3{-4, 0, 66}, {17.0F, 12.0F, 9.0F}, 3.0F), photo_body, 4.0F);
  f = join(f, cylinder_y(p - Vec3{-4, -22, 31}, 21.0F, 10.0F, 1.5F), photo_body);
  f = join(f, cylinder_y(p - Vec3{-4, -33, 31}, 18.0F, 8.0F, 1.5F), photo_lens);
  f = cut(f, cylinder_y(p - Vec3{-4, -42, 31}, 14.5F, 6.0F, 0.5F));
  f = join(f, ellipsoid(p - Vec3{-4, -33, 31}, {14.6F, 5.0F, 14.6F}), photo_glass);
  f = join(f, box(p - Vec3{31, -15, 52}, {9.0F, 2.0F, 5.0F}, 1.0F), photo_flash);
  f = join(f, cylinder_z(p - Vec3{31, 2, 65}, 8.5F, 4.0F, 1.0F), photo_knob);
  f = join(f, cylinder_z(p - Vec3{-33, 0, 65}, 5.5F, 3.5F, 1.0F), photo_button);
  return {std::max(f.distance, 4.2F - p.z), f.part};
}

Paint photo_paint(Vec3 p, Vec3 n, int part) {
  switch (part) {
    case photo_leather: {
      const float grain = value_noise(0.9F * p);
      return {mix(srgb(0x5A3826), srgb(0x4A2C1C), grain), 0.03F, 0.7F, 0.0F};
    }
    case photo_lens: {
      const bool ring =
          std::abs(p.y + 31.0F) < 2.2F && std::sin(46.0F * std::atan2(p.z - 31.0F, p.x + 4.0F)) > 0.0F;
      return {ring ? srgb(0x6A6A6E) : srgb(0x3A3A3E), 0.05F, 0.3F, 0.0F};
    }
    case photo_glass:
      return {srgb(0x24344E), 0.12F, 0.04F, 0.0F};
    case photo_flash:
      return {srgb(0xEEF2F4), 0.06F, 0.1F, 0.0F};
    case photo_knob:
      return {srgb(0xB9B9BD), 0.6F, 0.3F, 1.0F};
    case photo_button:
      return {srgb(0xC2342E), 0.05F, 0.2F, 0.0F};
    default:
      break;
  }
  Paint paint{srgb(0xBDB9AE), 0.35F, 0.32F, 0.6F};
  if (n.y < -0.8F && p.z > 60.0F && std::abs(p.z - 66.0F) < 6.0F) {
    const bool letter = glyph('E', (p.x + 9.5F) / 6.5F, (p.z - 66.0F) / 6.5F) < 0.15F ||
                        glyph('P', (p.x - 1.5F) / 6.5F, (p.z - 66.0F) / 6.5F) < 0.15F;
    if (letter) paint.albedo = srgb(0x2A2A2E);
  }
  if (n.y > 0.8F && std::abs(p.x + 4.0F) < 9.0F && std::abs(p.z - 66.0F) < 4.5F) {
    return {srgb(0x2A3440), 0.08F, 0.08F, 0.0F};  // the eyepiece at the back
  }
  return paint;
}

// Tug boat, sails towards −x --------------------------------------------------------------------------------

enum BoatPart { boat_hull, boat_deck, boat_cabin, boat_funnel, boat_fender, boat_roof };

Field boat_field(Vec3 p) {
  const Vec3 m{p.x, std::abs(p.y), p.z};
  // The hull narrows to the bow and to the keel.
  const float bow = smooth_step(5.0F, -58.0F, p.x);
  const float beam = 25.0F * (1.0F - 0.85F * bow * bow) * (0.72F + 0.28F * smooth_step(0.0F, 22.0F, p.z));
  const float rise = 8.0F * bow;
  Field f{0.75F * std::max({m.y - beam, std::abs(p.x + 2.0F) - 54.0F, p.z - 24.0F - rise, 0.4F - p.z}),
          boat_hull};
  const float well = std::max({m.y - beam + 3.0F, std::abs(p.x + 2.0F) - 51.0F, 20.0F + rise - p.z});
  f = cut(f, 0.75F * well, boat_deck);
  f = join(f, box(p - Vec3{2, 0, 32}, {19.0F, 14.0F, 16.0F}, 2.0F), boat_cabin);
  f = join(f, box(p - Vec3{0, 0, 49}, {22.0F, 16.5F, 2.0F}, 1.2F), boat_roof);
  f = join(f, box(p - Vec3{-10, 0, 57}, {8.0F, 10.0F, 8.0F}, 1.5F), boat_cabin);
  f = join(f, cone_z(p - Vec3{14, 0, 0}, 48.0F, 8.5F, 76.0F, 6.5F), boat_funnel);
  f = join(f, torus_y(m - Vec3{22, 26, 16}, 5.5F, 2.6F), boat_fender);
  f = join(f, torus_y(m - Vec3{-4, 25.5F, 16}, 5.5F, 2.6F), boat_fender);
  return join(f, capsule(p, {36, 0, 20}, {36, 0, 42}, 1.8F), boat_funnel);
}

Paint boat_paint(Vec3 p, Vec3 n, int part) {
  const Vec3 white = srgb(0xEDE8DC);
  switch (part) {
    case boat_deck: {
      const bool seam = std::abs(std::remainder(p.y, 5.0F)) < 0.35F;
      return {seam ? srgb(0x6E4A2A) : mix(srgb(0xB9854E), srgb(0xA06E3C), value_noise({0.05F * p.x, p.y, 0})),
              0.03F, 0.5F, 0.0F};
    }
    case boat_fender:
      return {srgb(0x4A4A4E), 0.03F, 0.8F, 0.0F};
    case boat_funnel:
      return {p.z > 68.0F ? srgb(0x2C2C30) : p.z > 60.0F ? white : srgb(0xD9822B), 0.05F, 0.3F, 0.0F};
    case boat_roof:
      return {srgb(0x2F5D8A), 0.05F, 0.3F, 0.0F};
    case boat_cabin: {
      const bool upper = p.z > 50.0F;
      if (upper && p.z > 56.0F && p.z < 62.5F && std::abs(n.z) < 0.5F)
        return {srgb(0x33424E), 0.08F, 0.08F, 0.0F};
      if (!upper && std::abs(n.y) > 0.7F) {
        // Portholes; a door only on the boat's right.
        if (p.y < 0.0F && std::abs(p.x - 12.0F) < 4.5F && p.z < 42.0F)
          return {srgb(0x8A3B2E), 0.04F, 0.4F, 0.0F};
        for (const float x : {-10.0F, 0.0F}) {
          if (std::hypot(p.x - x, p.z - 36.0F) < 3.6F) return {srgb(0x33424E), 0.08F, 0.08F, 0.0F};
        }
      }
      return {white, 0.05F, 0.3F, 0.0F};
    }
    default:
      break;
  }
  Vec3 hull = p.z < 9.0F ? srgb(0x7A2A26) : p.z < 11.5F ? white : srgb(0x9C2F2A);
  if (p.z >= 11.5F) hull = srgb(0x23566E);
  if (std::abs(n.y) > 0.5F && p.x < -20.0F && p.x > -34.0F) {
    const float x = (p.y < 0.0F ? 1.0F : -1.0F) * (p.x + 27.0F);
    if (glyph('3', x / 9.0F, (p.z - 21.0F) / 9.0F) < 0.13F) hull = white;
  }
  return {hull, 0.05F, 0.25F, 0.0F};
}

// Robot, looks towards −y -----------------------------------------------------------------------------------

enum RobotPart { robot_body, robot_head, robot_eye, robot_arm, robot_foot, robot_ball, robot_grip };

Field robot_field(Vec3 p) {
  const Vec3 m{std::abs(p.x), p.y, p.z};
  Field f{box(p - Vec3{0, 0, 42}, {20.0F, 14.0F, 21.0F}, 3.0F), robot_body};
  f = join(f, box(turn_z(p - Vec3{0, 0, 78}, 18.0F), {15.0F, 12.0F, 12.0F}, 3.0F), robot_head);
  f = join(f, cylinder_z(p - Vec3{0, 0, 65}, 6.0F, 5.0F), robot_arm);
  const Vec3 head = turn_z(p - Vec3{0, 0, 78}, 18.0F);
  f = join(f, cylinder_y(Vec3{std::abs(head.x), head.y, head.z} - Vec3{6.5F, -12, 2}, 4.2F, 2.0F, 0.6F),
           robot_eye);
  f = join(f, capsule(p, {0, 0, 88}, {0, 0, 99}, 1.4F), robot_arm);
  f = join(f, sphere(p - Vec3{0, 0, 101}, 3.6F), robot_ball);
  // Its right arm points forward, its left one hangs.
  f = join(f, capsule(p, {-20, 0, 55}, {-28, 0, 54}, 5.0F), robot_arm);
  f = join(f, capsule(p, {-28, 0, 54}, {-29, -26, 50}, 4.5F), robot_arm);
  f = join(f, sphere(p - Vec3{-29, -30, 49}, 6.5F), robot_grip);
  f = join(f, capsule(p, {20, 0, 55}, {28, 0, 54}, 5.0F), robot_arm);
  f = join(f, capsule(p, {28, 0, 54}, {30, -3, 28}, 4.5F), robot_arm);
  f = join(f, sphere(p - Vec3{30, -4, 24}, 6.5F), robot_grip);
  f = join(f, capsule(m, {10, 0, 22}, {10, 0, 10}, 5.0F), robot_arm);
  return join(f, box(m - Vec3{10.5F, -4, 5}, {8.5F, 13.0F, 4.8F}, 2.0F), robot_foot);
}

Paint robot_paint(Vec3 p, Vec3 n, int part) {
  switch (part) {
    case robot_eye:
      return {srgb(0xF2D03B), 0.06F, 0.1F, 0.0F};
    case robot_ball:
      return {srgb(0xD22F2F), 0.06F, 0.1F, 0.0F};
    case robot_grip:
      return {srgb(0xD9822B), 0.05F, 0.3F, 0.0F};
    case robot_arm:
      return {srgb(0x9A9AA0), 0.5F, 0.35F, 1.0F};
    case robot_foot:
      return {srgb(0x5B6470), 0.05F, 0.4F, 0.0F};
    case robot_head:
      return {srgb(0x8FA6B8), 0.3F, 0.3F, 0.3F};
    default:
      break;
  }
  Vec3 colour = srgb(0x6F8CA6);
  if (n.y < -0.7F && std::abs(p.x) < 15.0F && std::abs(p.z - 44.0F) < 14.0F) {
    colour = srgb(0x2B3640);
    if (std::hypot(p.x + 7.0F, p.z - 50.0F) < 4.0F) colour = srgb(0xD22F2F);
    if (std::hypot(p.x - 5.0F, p.z - 50.0F) < 4.0F) colour = srgb(0x46A758);
    if (p.z < 42.0F && p.z > 34.0F && std::sin(1.3F * p.x) > 0.0F) colour = srgb(0xE9E4D4);
  }
  if (n.y > 0.7F && glyph('R', -p.x / 16.0F, (p.z - 43.0F) / 16.0F) < 0.12F) colour = srgb(0xE9E4D4);
  if (std::abs(n.x) > 0.7F && std::abs(std::remainder(p.z, 8.0F)) < 1.2F && p.x > 0.0F)
    colour = srgb(0x3C5266);
  return {colour, 0.3F, 0.3F, 0.3F};
}

}  // namespace

Shape car() {
  return {car_field, car_paint, {-59, -26, 0}, {59, 26, 51}, 1.3F};
}
Shape photo_camera() {
  return {photo_field, photo_paint, {-48, -43, 4}, {48, 17, 76}, 1.3F};
}
Shape boat() {
  return {boat_field, boat_paint, {-57, -30, 0}, {53, 30, 77}, 1.3F};
}
Shape robot() {
  return {robot_field, robot_paint, {-37, -38, 0}, {38, 15, 106}, 1.3F};
}

}  // namespace eigenpose::sim::objects
