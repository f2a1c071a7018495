#include "sim/scene/objects.h"

namespace eigenpose::sim::objects {
namespace {

enum HandPart { hand_skin, hand_cuff, hand_sleeve };

// Reaches towards −x, the arm goes along +x out of the picture; fingers closed downwards around the origin.
Field hand_field(Vec3 p) {
  Field f{ellipsoid(p - Vec3{44, 0, 22}, {30.0F, 22.0F, 12.0F}), hand_skin};
  for (int i = 0; i < 4; ++i) {
    const float y = -17.0F + 11.0F * static_cast<float>(i);
    const float reach = i == 1 || i == 2 ? 4.0F : 0.0F;
    f = blend(f, capsule(p, {28, y, 22}, {4 - reach, y * 0.8F, 16}, 7.0F, 6.0F), hand_skin, 3.0F);
    f = blend(f, capsule(p, {4 - reach, y * 0.8F, 16}, {-6 - reach, y * 0.6F, -6}, 6.0F, 5.0F), hand_skin,
              2.0F);
  }
  f = blend(f, capsule(p, {46, -18, 16}, {22, -26, 2}, 8.0F, 6.5F), hand_skin, 5.0F);
  f = blend(f, capsule(p, {22, -26, 2}, {6, -20, -8}, 6.5F, 5.5F), hand_skin, 2.0F);
  f = blend(f, capsule(p, {62, 0, 24}, {110, 0, 34}, 17.0F, 19.0F), hand_skin, 10.0F);
  f = join(f, capsule(p, {112, 0, 35}, {120, 0, 37}, 25.0F), hand_cuff);
  return join(f, capsule(p, {124, 0, 38}, {330, 0, 92}, 27.0F, 36.0F), hand_sleeve);
}

Paint hand_paint(Vec3 p, Vec3, int part) {
  if (part == hand_cuff) return {srgb(0xE9E6DE), 0.02F, 0.8F, 0.0F};
  if (part == hand_sleeve) {
    const bool check = std::sin(0.22F * p.x) > 0.55F || std::sin(0.22F * p.y + 0.6F) > 0.6F;
    return {check ? srgb(0x5577A0) : srgb(0x33557F), 0.02F, 0.9F, 0.0F};
  }
  const float blush = cloud_noise(0.06F * p, 3);
  return {mix(srgb(0xD9A07F), srgb(0xC07A60), 0.7F * blush), 0.03F, 0.55F, 0.0F};
}

}  // namespace

Shape hand() {
  return {hand_field, hand_paint, {-18, -42, -16}, {370, 42, 130}, 2.5F};
}

}  // namespace eigenpose::sim::objects
