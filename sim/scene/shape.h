#pragma once

/// A solid by its signed distance, with a surface painted in place.
///
/// Objects are written as functions of a point in their own frame (millimetres, z up, standing on z = 0):
/// unions, cuts and blends of primitives. The mesh for ray casting is made from the function, the paint is
/// evaluated where a ray hits, so that patterns stay crisp at any resolution.

#include <algorithm>
#include <cmath>

#include "sim/scene/vec3.h"

namespace eigenpose::sim {

/// Distance to a solid, negative inside, and which of its parts is nearest.
struct Field {
  float distance = 1e9F;
  int part = 0;
};

/// What light does at a point of the surface.
struct Paint {
  Vec3 albedo{0.5F, 0.5F, 0.5F};  ///< diffuse reflectance, linear
  float specular = 0.04F;         ///< reflectance at normal incidence
  float roughness = 0.5F;         ///< 0.05 polished … 1 matt
  float metal = 0.0F;             ///< 1: the reflection takes the albedo's colour and nothing is diffuse
};

struct Shape {
  Field (*field)(Vec3 point) = nullptr;
  Paint (*paint)(Vec3 point, Vec3 normal, int part) = nullptr;
  Vec3 lower;  ///< box that holds the solid
  Vec3 upper;
  float cell = 1.3F;  ///< edge of the mesh's grid
};

// Distances of primitives, all in millimetres. ------------------------------------------------------------

inline float sphere(Vec3 p, float radius) {
  return length(p) - radius;
}

/// Not exact far away, but its zero is: enough for a mesh.
inline float ellipsoid(Vec3 p, Vec3 radii) {
  const float k0 = length({p.x / radii.x, p.y / radii.y, p.z / radii.z});
  const float k1 = length({p.x / (radii.x * radii.x), p.y / (radii.y * radii.y), p.z / (radii.z * radii.z)});
  return k1 > 0.0F ? k0 * (k0 - 1.0F) / k1 : -std::min({radii.x, radii.y, radii.z});
}

/// @param half half of its sides, rounding included.
inline float box(Vec3 p, Vec3 half, float rounding = 1.0F) {
  const Vec3 q{std::abs(p.x) - half.x + rounding, std::abs(p.y) - half.y + rounding,
               std::abs(p.z) - half.z + rounding};
  const Vec3 outside{std::max(q.x, 0.0F), std::max(q.y, 0.0F), std::max(q.z, 0.0F)};
  return length(outside) + std::min(std::max({q.x, q.y, q.z}), 0.0F) - rounding;
}

/// Around the z axis, from −half to +half.
inline float cylinder_z(Vec3 p, float radius, float half, float rounding = 0.8F) {
  const float a = std::hypot(p.x, p.y) - radius + rounding;
  const float b = std::abs(p.z) - half + rounding;
  return std::min(std::max(a, b), 0.0F) + std::hypot(std::max(a, 0.0F), std::max(b, 0.0F)) - rounding;
}
inline float cylinder_x(Vec3 p, float radius, float half, float rounding = 0.8F) {
  return cylinder_z({p.y, p.z, p.x}, radius, half, rounding);
}
inline float cylinder_y(Vec3 p, float radius, float half, float rounding = 0.8F) {
  return cylinder_z({p.z, p.x, p.y}, radius, half, rounding);
}

/// From a to b, its radius going from ra to rb.
inline float capsule(Vec3 p, Vec3 a, Vec3 b, float ra, float rb) {
  const Vec3 pa = p - a;
  const Vec3 ba = b - a;
  const float h = std::clamp(dot(pa, ba) / dot(ba, ba), 0.0F, 1.0F);
  return length(pa - h * ba) - mix(ra, rb, h);
}
inline float capsule(Vec3 p, Vec3 a, Vec3 b, float radius) {
  return capsule(p, a, b, radius, radius);
}

/// Around the z axis, in the plane z = 0.
inline float torus_z(Vec3 p, float ring, float tube) {
  return std::hypot(std::hypot(p.x, p.y) - ring, p.z) - tube;
}
inline float torus_x(Vec3 p, float ring, float tube) {
  return torus_z({p.y, p.z, p.x}, ring, tube);
}
inline float torus_y(Vec3 p, float ring, float tube) {
  return torus_z({p.z, p.x, p.y}, ring, tube);
}

/// Around the z axis: radius `r0` at z = z0, `r1` at z = z1, flat ends.
inline float cone_z(Vec3 p, float z0, float r0, float z1, float r1) {
  const float t = std::clamp((p.z - z0) / (z1 - z0), 0.0F, 1.0F);
  const float slope = (r1 - r0) / (z1 - z0);
  const float side = (std::hypot(p.x, p.y) - mix(r0, r1, t)) / std::sqrt(1.0F + slope * slope);
  return std::max({side, z0 - p.z, p.z - z1});
}

// Combinations. ---------------------------------------------------------------------------------------

inline Field join(Field a, Field b) {
  return a.distance <= b.distance ? a : b;
}
inline Field join(Field a, float distance, int part) {
  return join(a, Field{distance, part});
}
inline float smooth_min(float a, float b, float radius) {
  const float h = std::max(radius - std::abs(a - b), 0.0F) / radius;
  return std::min(a, b) - 0.25F * h * h * radius;
}
/// A union with a fillet of about `radius`.
inline Field blend(Field a, float distance, int part, float radius) {
  return {smooth_min(a.distance, distance, radius), a.distance <= distance ? a.part : part};
}
/// What is left of `a` outside the solid of `cutter`.
inline Field cut(Field a, float cutter) {
  return {std::max(a.distance, -cutter), a.part};
}
/// The wall left by a cut belongs to `part`.
inline Field cut(Field a, float cutter, int part) {
  return a.distance >= -cutter ? a : Field{-cutter, part};
}

// Places. -----------------------------------------------------------------------------------------------

inline Vec3 turn_z(Vec3 p, float degrees_value) {
  const float a = degrees_value * 0.01745329252F;
  const float c = std::cos(a);
  const float s = std::sin(a);
  return {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
}
inline Vec3 turn_y(Vec3 p, float degrees_value) {
  const Vec3 q = turn_z({p.z, p.x, p.y}, degrees_value);
  return {q.y, q.z, q.x};
}
inline Vec3 turn_x(Vec3 p, float degrees_value) {
  const Vec3 q = turn_z({p.y, p.z, p.x}, degrees_value);
  return {q.z, q.x, q.y};
}

// Patterns. ---------------------------------------------------------------------------------------------

/// A smooth field of values in [0, 1], about one bump per unit.
float value_noise(Vec3 p);
/// Several octaves of it, [0, 1].
float cloud_noise(Vec3 p, int octaves = 4);
/// Linear colour from an sRGB value, 0xRRGGBB; a cubic within 0.2 % of the standard's curve.
constexpr Vec3 srgb(unsigned hex) {
  const auto linear = [](unsigned byte) {
    const float v = static_cast<float>(byte) / 255.0F;
    return v * (v * (v * 0.305306011F + 0.682171111F) + 0.012522878F);
  };
  return {linear((hex >> 16U) & 255U), linear((hex >> 8U) & 255U), linear(hex & 255U)};
}
/// Distance in the plane to a capital letter or digit drawn in strokes, its box [−0.5, 0.5] × [−0.7, 0.7].
/// Less than half the wanted stroke width means ink. Known: A B C D E F H K L N P R S T X 1 2 3 4 5 7; 1e9
/// for any other.
float glyph(char letter, float x, float y);

}  // namespace eigenpose::sim
