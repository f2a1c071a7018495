#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

// Letter blocks: alike but for one letter and one colour ---------------------------------------------------

constexpr float block_half = 30.0F;

Field block_field(Vec3 p) {
  return {box(p - Vec3{0, 0, block_half}, {block_half, block_half, block_half}, 3.0F), 0};
}

/// One face: a coloured frame around wood, a letter in the frame's colour.
Vec3 block_face(char letter, unsigned ink, float u, float v, Vec3 wood) {
  const float edge = std::max(std::abs(u), std::abs(v));
  if (edge > 20.5F && edge < 25.0F) return srgb(ink);
  if (glyph(letter, u / 23.0F, v / 23.0F) < 0.105F) return srgb(ink);
  return wood;
}

Paint block_paint(Vec3 p, Vec3 n, char front, char right, unsigned right_ink) {
  const Vec3 grain{0.35F * p.x, 0.05F * p.y, 0.35F * p.z};
  const Vec3 wood = mix(srgb(0xDDB77E), srgb(0xC3935A), cloud_noise(grain, 3));
  const float z = p.z - block_half;
  Vec3 colour = wood;
  if (n.z > 0.7F) {
    colour = block_face('B', 0x3D7A3F, p.x, p.y, wood);
  } else if (n.y < -0.7F) {
    colour = block_face(front, 0xB3322C, p.x, z, wood);
  } else if (n.x > 0.7F) {
    colour = block_face(right, right_ink, p.y, z, wood);
  } else if (n.y > 0.7F) {
    colour = block_face('K', 0x8A5A1F, -p.x, z, wood);
  } else if (n.x < -0.7F) {
    colour = block_face('5', 0x6B3F8C, -p.y, z, wood);
  }
  return {colour, 0.04F, 0.35F, 0.0F};
}

Paint block_a_paint(Vec3 p, Vec3 n, int) {
  return block_paint(p, n, 'A', 'E', 0x2C5FA8);
}
Paint block_b_paint(Vec3 p, Vec3 n, int) {
  return block_paint(p, n, 'H', 'E', 0x2A8C86);
}

// House -----------------------------------------------------------------------------------------------------

enum HousePart { house_wall, house_roof, house_chimney, house_base, house_porch };

Field house_field(Vec3 p) {
  Field f{box(p - Vec3{0, 0, 25}, {34.0F, 26.0F, 24.0F}, 0.8F), house_wall};
  const float gable = std::max(std::abs(p.x) - 34.0F, 0.0F);
  const float under_roof = (0.72F * std::abs(p.y) + p.z - 68.0F) * 0.81F;
  f = join(f, std::max({under_roof, std::abs(p.x) - 34.0F, 40.0F - p.z, gable}), house_wall);
  const float slab =
      std::max({(0.72F * std::abs(p.y) + p.z - 72.5F) * 0.81F, -(0.72F * std::abs(p.y) + p.z - 67.0F) * 0.81F,
                std::abs(p.x) - 39.0F, std::abs(p.y) - 33.0F});
  f = join(f, slab, house_roof);
  f = join(f, box(p - Vec3{-19, 13, 68}, {6.0F, 6.0F, 14.0F}, 0.6F), house_chimney);
  f = join(f, box(p - Vec3{0, 0, 1.5F}, {40.0F, 34.0F, 1.5F}, 0.6F), house_base);
  return join(f, box(p - Vec3{12, -30, 17}, {9.0F, 6.0F, 15.0F}, 0.8F), house_porch);
}

bool window_at(float u, float z, float at_u, float at_z, Vec3& colour) {
  const float du = std::abs(u - at_u);
  const float dz = std::abs(z - at_z);
  if (du > 7.0F || dz > 8.0F) return false;
  const bool bar = du > 5.6F || dz > 6.6F || du < 0.7F || dz < 0.7F;
  colour = bar ? srgb(0xF3EFE4) : srgb(0x4A6478);
  return true;
}

Paint house_paint(Vec3 p, Vec3 n, int part) {
  switch (part) {
    case house_roof: {
      const float row = (std::abs(p.y) * 1.23F) / 5.0F;
      const float along = p.x / 6.0F + 0.5F * std::floor(row);
      const bool gap = row - std::floor(row) < 0.16F || along - std::floor(along) < 0.1F;
      return {gap ? srgb(0x6E2A1E)
                  : mix(srgb(0xA8472F), srgb(0x8E3826), value_noise({std::floor(along), std::floor(row), 3})),
              0.03F, 0.7F, 0.0F};
    }
    case house_chimney: {
      const bool mortar = std::abs(std::remainder(p.z, 4.0F)) < 0.5F;
      return {mortar ? srgb(0xB8AA98) : srgb(0x8C4A38), 0.03F, 0.8F, 0.0F};
    }
    case house_base:
      return {mix(srgb(0x5E8C3E), srgb(0x47722C), cloud_noise(0.4F * p, 2)), 0.02F, 0.9F, 0.0F};
    case house_porch:
      return {n.y < -0.7F && std::abs(p.x - 12.0F) < 6.0F && p.z < 26.0F ? srgb(0x2F5D8A) : srgb(0xC9A36A),
              0.03F, 0.5F, 0.0F};
    default:
      break;
  }
  Vec3 colour = mix(srgb(0xEAD9A8), srgb(0xDCC78F), cloud_noise(0.15F * p, 2));
  Vec3 window;
  const bool front = n.y < -0.7F && (window_at(p.x, p.z, -20.0F, 26.0F, window));
  const bool back =
      n.y > 0.7F && (window_at(p.x, p.z, -17.0F, 28.0F, window) || window_at(p.x, p.z, 0.0F, 28.0F, window) ||
                     window_at(p.x, p.z, 17.0F, 28.0F, window));
  const bool right =
      n.x > 0.7F && (window_at(p.y, p.z, -11.0F, 26.0F, window) || window_at(p.y, p.z, 11.0F, 26.0F, window));
  const bool left = n.x < -0.7F && std::hypot(p.y, p.z - 38.0F) < 9.0F;
  if (front || back || right) colour = window;
  if (left) colour = std::hypot(p.y, p.z - 38.0F) < 7.5F ? srgb(0x4A6478) : srgb(0xF3EFE4);
  return {colour, 0.03F, 0.6F, 0.0F};
}

// Boot, toe towards −x
// ---------------------------------------------------------------------------------------

enum ShoePart { shoe_leather, shoe_sole, shoe_inside, shoe_lace };

Field shoe_field(Vec3 p) {
  Field f{capsule(p, {22, 0, 26}, {24, 0, 72}, 19.0F, 20.0F), shoe_leather};
  f = blend(f, ellipsoid(p - Vec3{-14, 1, 16}, {42.0F, 20.0F, 18.0F}), shoe_leather, 14.0F);
  f = {std::max({f.distance, p.z - 74.0F, 3.0F - p.z}), f.part};
  f = cut(f, capsule(p, {23, 0, 40}, {24, 0, 90}, 15.5F, 17.0F), shoe_inside);
  const float outline = std::min(cylinder_z(p - Vec3{22, 0, 3.5F}, 22.0F, 3.5F, 1.0F),
                                 std::max(ellipsoid({p.x + 14.0F, p.y - 1.0F, 0.0F}, {45.0F, 22.5F, 9.0F}),
                                          std::abs(p.z - 3.5F) - 3.5F));
  f = join(f, outline, shoe_sole);
  for (int i = 0; i < 4; ++i) {
    const float t = static_cast<float>(i);
    f = join(
        f,
        capsule(p, {-6.0F + 4.5F * t, -9, 35.0F + 8.5F * t}, {-6.0F + 4.5F * t, 9, 33.0F + 8.5F * t}, 1.7F),
        shoe_lace);
  }
  return f;
}

Paint shoe_paint(Vec3 p, Vec3, int part) {
  switch (part) {
    case shoe_sole:
      return {p.z > 5.0F ? srgb(0xD8C9A0) : srgb(0x4E3A2C), 0.03F, 0.8F, 0.0F};
    case shoe_inside:
      return {srgb(0xB99A70), 0.02F, 0.9F, 0.0F};
    case shoe_lace:
      return {srgb(0xEAE2CC), 0.02F, 0.8F, 0.0F};
    default:
      break;
  }
  const float worn = cloud_noise(0.09F * p, 4);
  Vec3 leather = mix(srgb(0x8C5A30), srgb(0x5F3A1E), worn);
  if (p.x < -34.0F) leather = srgb(0x4B2E1A);                                                // toe cap
  if (p.y > 0.0F && std::hypot(p.x - 24.0F, p.z - 54.0F) < 10.0F) leather = srgb(0xB03A30);  // a patch inside
  if (p.y > 0.0F && glyph('N', -(p.x - 24.0F) / 9.0F, (p.z - 54.0F) / 9.0F) < 0.13F) leather = srgb(0xEAE2CC);
  const bool seam = std::abs(p.z - 68.0F) < 0.8F || (std::abs(p.x - 34.0F) < 0.8F && p.z > 8.0F);
  if (seam) leather = srgb(0xD8B070);
  return {leather, 0.04F, 0.4F, 0.0F};
}

}  // namespace

Shape block_a() {
  return {block_field, block_a_paint, {-30, -30, 0}, {30, 30, 60}, 1.6F};
}
Shape block_b() {
  return {block_field, block_b_paint, {-30, -30, 0}, {30, 30, 60}, 1.6F};
}
Shape house() {
  return {house_field, house_paint, {-41, -38, 0}, {41, 35, 83}, 1.6F};
}
Shape shoe() {
  return {shoe_field, shoe_paint, {-60, -25, 0}, {47, 25, 76}, 1.6F};
}

}  // namespace eigenpose::sim::objects
