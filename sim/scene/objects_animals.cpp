#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

// Duck: swims towards −y -----------------------------------------------------------------------------------

enum DuckPart { duck_body, duck_beak, duck_eye, duck_wing };

Field duck_field(Vec3 p) {
  const Vec3 m{std::abs(p.x), p.y, p.z};
  Field f{ellipsoid(p - Vec3{0, 4, 26}, {29.0F, 40.0F, 26.0F}), duck_body};
  f = blend(f, capsule(p, {0, 34, 34}, {0, 50, 50}, 11.0F, 3.0F), duck_body, 14.0F);
  f = blend(f, sphere(p - Vec3{0, -20, 66}, 20.0F), duck_body, 12.0F);
  f = blend(f, ellipsoid(turn_x(m - Vec3{27, 8, 32}, 18.0F), {7.0F, 24.0F, 14.0F}), duck_wing, 4.0F);
  const float beak = std::min(ellipsoid(turn_x(p - Vec3{0, -43, 63}, -10.0F), {9.5F, 12.0F, 3.4F}),
                              ellipsoid(turn_x(p - Vec3{0, -41, 59}, 12.0F), {8.0F, 9.0F, 2.8F}));
  f = join(f, beak, duck_beak);
  f = join(f, sphere(m - Vec3{9.5F, -35.5F, 73}, 4.2F), duck_eye);
  return {std::max(f.distance, 0.6F - p.z), f.part};
}

Paint duck_paint(Vec3 p, Vec3, int part) {
  if (part == duck_beak) return {srgb(0xE2641B), 0.05F, 0.3F, 0.0F};
  if (part == duck_eye) {
    const bool glint = std::hypot(std::abs(p.x) - 8.5F, p.z - 75.0F) < 1.4F && p.y < -37.5F;
    return {glint ? srgb(0xFFFFFF) : srgb(0x202024), 0.06F, 0.1F, 0.0F};
  }
  Vec3 yellow = srgb(0xF2C01E);
  if (part == duck_wing) {
    const float feather = std::sin(0.55F * (p.y + 1.4F * p.z));
    if (feather > 0.55F && p.y > 2.0F) yellow = srgb(0xC98A12);
  }
  // A neckerchief with white dots, its knot on the duck's left.
  if (part == duck_body && p.z > 46.0F + 0.25F * (p.y + 20.0F) && p.z < 54.0F + 0.25F * (p.y + 20.0F) &&
      p.y < 6.0F) {
    const float angle = std::atan2(p.y + 16.0F, p.x);
    const bool dot = std::sin(7.0F * angle) > 0.75F;
    return {dot ? srgb(0xF4F1E8) : srgb(0x2A5AA0), 0.03F, 0.7F, 0.0F};
  }
  return {yellow, 0.045F, 0.28F, 0.0F};
}

// Cat, sitting, looks towards −y ----------------------------------------------------------------------------

enum CatPart { cat_fur, cat_eye, cat_nose, cat_ear, cat_collar };

Field cat_field(Vec3 p) {
  const Vec3 m{std::abs(p.x), p.y, p.z};
  Field f{ellipsoid(p - Vec3{0, 10, 28}, {24.0F, 28.0F, 28.0F}), cat_fur};
  f = blend(f, ellipsoid(p - Vec3{0, -6, 44}, {17.0F, 16.0F, 26.0F}), cat_fur, 14.0F);
  f = blend(f, ellipsoid(m - Vec3{20, 4, 13}, {10.0F, 20.0F, 13.0F}), cat_fur, 6.0F);
  f = blend(f, capsule(m, {8, -18, 40}, {8.5F, -21, 5}, 6.5F, 5.5F), cat_fur, 4.0F);
  f = blend(f, ellipsoid(m - Vec3{9, -25, 4}, {6.0F, 8.0F, 4.5F}), cat_fur, 3.0F);
  const float tail = std::min(capsule(p, {14, 34, 6}, {30, 14, 5}, 6.0F, 5.0F),
                              capsule(p, {30, 14, 5}, {31, -14, 6}, 5.0F, 3.5F));
  f = blend(f, tail, cat_fur, 4.0F);
  const Vec3 head = turn_z(p - Vec3{0, -14, 76}, 12.0F);  // looks a little aside
  const Vec3 hm{std::abs(head.x), head.y, head.z};
  f = blend(f, ellipsoid(head, {20.5F, 17.5F, 17.0F}), cat_fur, 6.0F);
  f = blend(f, capsule(hm, {12.5F, 3, 11}, {15.5F, 3, 24}, 6.0F, 1.2F), cat_ear, 3.0F);
  f = blend(f, ellipsoid(hm - Vec3{5, -15, -5.5F}, {6.5F, 5.0F, 4.5F}), cat_fur, 3.0F);
  f = join(f, sphere(hm - Vec3{7.5F, -14.2F, 3.5F}, 4.0F), cat_eye);
  f = join(f, sphere(head - Vec3{0, -19.5F, -2.5F}, 2.4F), cat_nose);
  f = join(f, torus_z(turn_x(p - Vec3{0, -9.5F, 60.5F}, 14.0F), 15.5F, 2.3F), cat_collar);
  return {std::max(f.distance, 0.4F - p.z), f.part};
}

Paint cat_paint(Vec3 p, Vec3, int part) {
  switch (part) {
    case cat_eye: {
      const Vec3 head = turn_z(p - Vec3{0, -14, 76}, 12.0F);
      return {std::abs(std::abs(head.x) - 7.2F) < 1.1F ? srgb(0x18181A) : srgb(0x7FB23C), 0.06F, 0.1F, 0.0F};
    }
    case cat_nose:
      return {srgb(0xC06A70), 0.04F, 0.4F, 0.0F};
    case cat_collar:
      return {srgb(0xB12A33), 0.04F, 0.4F, 0.0F};
    default:
      break;
  }
  const float wobble = 5.0F * cloud_noise(0.07F * p, 3);
  const float stripe = std::sin(0.48F * (p.z + 0.55F * p.y) + wobble);
  Vec3 fur = mix(srgb(0xB7793A), srgb(0x6E421D), smooth_step(0.15F, 0.55F, stripe));
  const bool breast = p.y < -10.0F && std::abs(p.x) < 10.0F && p.z > 20.0F && p.z < 62.0F;
  const bool muzzle = p.z > 60.0F && p.y < -25.0F && p.z < 74.0F;
  const bool paws = p.z < 8.0F && p.y < -14.0F;
  if (breast || muzzle || paws) fur = srgb(0xE8DCC8);
  if (part == cat_ear && p.y < -14.5F) fur = srgb(0xC98F84);
  return {fur, 0.025F, 0.8F, 0.0F};
}

// Pigs: alike but for a patch and the ears' tips ------------------------------------------------------------

enum PigPart { pig_skin, pig_snout, pig_eye, pig_ear, pig_slot };

Field pig_field(Vec3 p) {
  const Vec3 m{std::abs(p.x), p.y, p.z};
  Field f{ellipsoid(p - Vec3{0, 3, 36}, {29.0F, 38.0F, 27.0F}), pig_skin};
  f = blend(f, capsule(m, {15, -18, 18}, {16, -20, 5}, 8.0F, 7.5F), pig_skin, 5.0F);
  f = blend(f, capsule(m, {15, 24, 18}, {16, 26, 5}, 8.0F, 7.5F), pig_skin, 5.0F);
  f = blend(f, sphere(p - Vec3{0, -30, 44}, 20.0F), pig_skin, 10.0F);
  f = blend(f, cylinder_y(p - Vec3{0, -50, 41}, 8.5F, 5.0F, 2.0F), pig_snout, 3.0F);
  f = cut(f, capsule(m, {3.2F, -52, 41.5F}, {3.2F, -60, 41.5F}, 1.5F));
  f = blend(f, capsule(m, {10, -27, 59}, {17, -31, 69}, 6.0F, 2.0F), pig_ear, 2.0F);
  f = join(f, sphere(m - Vec3{8.5F, -46.5F, 51}, 2.9F), pig_eye);
  const Vec3 q = p - Vec3{0, 43, 44};
  f = join(f, torus_x({q.x, q.y, q.z}, 5.0F, 1.9F), pig_skin);
  f = cut(f, box(p - Vec3{0, 8, 64}, {1.8F, 12.0F, 6.0F}, 0.5F), pig_slot);
  return {std::max(f.distance, 0.3F - p.z), f.part};
}

Paint pig_paint(Vec3 p, Vec3, int part) {
  switch (part) {
    case pig_eye:
      return {srgb(0x1C1A1C), 0.06F, 0.1F, 0.0F};
    case pig_slot:
      return {srgb(0x301C20), 0.02F, 0.8F, 0.0F};
    case pig_snout:
      return {srgb(0xD9737F), 0.045F, 0.2F, 0.0F};
    case pig_ear:
      return {srgb(0xD98691), 0.045F, 0.2F, 0.0F};
    default:
      break;
  }
  // A clover painted on its right side, hooves below.
  Vec3 skin = srgb(0xEAA3AC);
  if (p.z < 6.5F) skin = srgb(0x7A4A50);
  if (p.x < 0.0F) {
    const float y = p.y - 8.0F;
    const float z = p.z - 38.0F;
    const float leaf = 8.5F + 3.5F * std::cos(4.0F * std::atan2(z, y));
    if (std::hypot(y, z) < leaf) skin = srgb(0x3C8A4A);
    if (std::abs(y + 0.3F * z) < 1.2F && z < 0.0F && z > -17.0F) skin = srgb(0x3C8A4A);
  }
  return {skin, 0.045F, 0.18F, 0.0F};
}

Paint pig_patched_paint(Vec3 p, Vec3 n, int part) {
  Paint paint = pig_paint(p, n, part);
  const bool patch =
      p.x > 0.0F && std::hypot(p.y - 14.0F, 1.1F * (p.z - 46.0F)) <
                        11.0F + 3.0F * std::sin(3.0F * std::atan2(p.z - 46.0F, p.y - 14.0F) + 1.0F);
  if (part == pig_skin && patch) paint.albedo = srgb(0x8C4A55);
  if (part == pig_ear && p.z > 64.0F) paint.albedo = srgb(0x8C4A55);
  return paint;
}

}  // namespace

Shape duck() {
  return {duck_field, duck_paint, {-36, -56, 0}, {36, 54, 87}, 1.5F};
}
Shape cat() {
  return {cat_field, cat_paint, {-38, -36, 0}, {38, 42, 103}, 1.4F};
}
Shape pig() {
  return {pig_field, pig_paint, {-31, -57, 0}, {31, 52, 73}, 1.4F};
}
Shape pig_patched() {
  return {pig_field, pig_patched_paint, {-31, -57, 0}, {31, 52, 73}, 1.4F};
}

}  // namespace eigenpose::sim::objects
