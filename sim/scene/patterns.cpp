#include <array>
#include <cstdint>
#include <string_view>

#include "sim/scene/shape.h"

namespace eigenpose::sim {
namespace {

float lattice(int x, int y, int z) {
  auto h = static_cast<std::uint32_t>(x) * 0x8DA6B343U + static_cast<std::uint32_t>(y) * 0xD8163841U +
           static_cast<std::uint32_t>(z) * 0xCB1AB31FU;
  h = (h ^ (h >> 13)) * 0x5BD1E995U;
  h ^= h >> 15;
  return static_cast<float>(h & 0xFFFFU) / 65535.0F;
}

float fade(float t) {
  return t * t * (3.0F - 2.0F * t);
}

/// Points on a 5 × 7 grid as letters, column 'a'…'e' then row '0' (bottom)…'6'; strokes parted by spaces.
constexpr std::string_view strokes_of(char letter) {
  switch (letter) {
    case 'A':
      return "a0c6 c6e0 b2d2";
    case 'B':
      return "a0a6 a6d6 d6e5 e5e4 e4d3 d3a3 d3e2 e2e1 e1d0 d0a0";
    case 'C':
      return "e5d6 d6b6 b6a5 a5a1 a1b0 b0d0 d0e1";
    case 'D':
      return "a0a6 a6c6 c6e4 e4e2 e2c0 c0a0";
    case 'E':
      return "e6a6 a6a0 a0e0 a3d3";
    case 'F':
      return "e6a6 a6a0 a3d3";
    case 'H':
      return "a0a6 e0e6 a3e3";
    case 'K':
      return "a0a6 e6a2 c3e0";
    case 'L':
      return "a6a0 a0e0";
    case 'N':
      return "a0a6 a6e0 e0e6";
    case 'P':
      return "a0a6 a6d6 d6e5 e5e4 e4d3 d3a3";
    case 'R':
      return "a0a6 a6d6 d6e5 e5e4 e4d3 d3a3 c3e0";
    case 'S':
      return "e5d6 d6b6 b6a5 a5a4 a4b3 b3d3 d3e2 e2e1 e1d0 d0b0 b0a1";
    case 'T':
      return "a6e6 c6c0";
    case 'X':
      return "a0e6 a6e0";
    case '1':
      return "b5c6 c6c0 b0d0";
    case '2':
      return "a5b6 b6d6 d6e5 e5e4 e4a0 a0e0";
    case '3':
      return "a6e6 e6c3 c3e2 e2e1 e1d0 d0b0 b0a1";
    case '4':
      return "d0d6 d6a2 a2e2";
    case '5':
      return "e6a6 a6a3 a3d3 d3e2 e2e1 e1d0 d0a0";
    case '7':
      return "a6e6 e6b0";
    default:
      return "";
  }
}

float segment_distance(float px, float py, float ax, float ay, float bx, float by) {
  const float dx = bx - ax;
  const float dy = by - ay;
  const float t = std::clamp(((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy), 0.0F, 1.0F);
  return std::hypot(px - ax - t * dx, py - ay - t * dy);
}

}  // namespace

float value_noise(Vec3 p) {
  const auto cell = [](float v) { return static_cast<int>(std::floor(v)); };
  const int x = cell(p.x);
  const int y = cell(p.y);
  const int z = cell(p.z);
  const float fx = fade(p.x - static_cast<float>(x));
  const float fy = fade(p.y - static_cast<float>(y));
  const float fz = fade(p.z - static_cast<float>(z));
  const auto edge = [&](int j, int k) {
    return mix(lattice(x, y + j, z + k), lattice(x + 1, y + j, z + k), fx);
  };
  return mix(mix(edge(0, 0), edge(1, 0), fy), mix(edge(0, 1), edge(1, 1), fy), fz);
}

float cloud_noise(Vec3 p, int octaves) {
  float sum = 0.0F;
  float weight = 0.5F;
  float total = 0.0F;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * value_noise(p);
    total += weight;
    weight *= 0.5F;
    p = 2.03F * p + Vec3{17.1F, 5.3F, 9.7F};
  }
  return sum / total;
}

float glyph(char letter, float x, float y) {
  float best = 1e9F;
  const std::string_view strokes = strokes_of(letter);
  const auto column = [](char c) { return static_cast<float>(c - 'a') / 4.0F - 0.5F; };
  const auto row = [](char c) { return static_cast<float>(c - '0') / 6.0F * 1.4F - 0.7F; };
  for (std::size_t i = 0; i + 4 <= strokes.size(); i += 5) {
    best = std::min(best, segment_distance(x, y, column(strokes[i]), row(strokes[i + 1]),
                                           column(strokes[i + 2]), row(strokes[i + 3])));
  }
  return best;
}

}  // namespace eigenpose::sim
