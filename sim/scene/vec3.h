#pragma once

/// Three floats: a point or direction in millimetres, or a linear colour (red, green, blue).

#include <algorithm>
#include <cmath>

namespace eigenpose::sim {

struct Vec3 {
  float x = 0.0F;
  float y = 0.0F;
  float z = 0.0F;

  friend constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
  friend constexpr Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vec3 operator*(float s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
  friend constexpr bool operator==(Vec3, Vec3) = default;
  constexpr Vec3& operator+=(Vec3 b) { return *this = *this + b; }
};

constexpr float dot(Vec3 a, Vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
constexpr Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float length(Vec3 a) {
  return std::sqrt(dot(a, a));
}
inline Vec3 normalized(Vec3 a) {
  const float n = length(a);
  return n > 0.0F ? (1.0F / n) * a : Vec3{0.0F, 0.0F, 1.0F};
}
/// a at t = 0, b at t = 1.
constexpr Vec3 mix(Vec3 a, Vec3 b, float t) {
  return (1.0F - t) * a + t * b;
}
constexpr float mix(float a, float b, float t) {
  return (1.0F - t) * a + t * b;
}
/// 0 below `lower`, 1 above `upper`, smooth between.
constexpr float smooth_step(float lower, float upper, float x) {
  const float t = std::clamp((x - lower) / (upper - lower), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace eigenpose::sim
