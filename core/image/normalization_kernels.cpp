#include "core/image/normalization_kernels.h"

#include <algorithm>

namespace eigenpose {
namespace {

// One body, compiled once for every instruction set. This file is compiled with loop vectorisation on.
[[gnu::always_inline]] inline void subtract_body(const std::uint8_t* bytes, std::size_t count, int level,
                                                 float* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<float>(std::max(0, bytes[i] - level));
}

/// The levels repeat every three numbers; a block of 24 holds whole pixels and whole vectors.
constexpr std::size_t block = 24;

[[gnu::always_inline]] inline void subtract_three_body(const std::uint8_t* bytes, std::size_t count,
                                                       const std::uint8_t* level, float* out) {
  int levels[block];
  for (std::size_t i = 0; i < block; ++i) levels[i] = level[i % 3];
  std::size_t i = 0;
  for (; i + block <= count; i += block)
    for (std::size_t j = 0; j < block; ++j)
      out[i + j] = static_cast<float>(std::max(0, bytes[i + j] - levels[j]));
  for (; i < count; ++i) out[i] = static_cast<float>(std::max(0, bytes[i] - levels[i % block]));
}

[[gnu::always_inline]] inline void add_body(const float* __restrict in, float weight, std::size_t count,
                                            float* __restrict out) {
  for (std::size_t i = 0; i < count; ++i) out[i] += weight * in[i];
}

[[gnu::always_inline]] inline float largest_body(const float* in, std::size_t count) {
  constexpr std::size_t lanes = 16;
  float most[lanes] = {};
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    for (std::size_t j = 0; j < lanes; ++j) most[j] = in[i + j] > most[j] ? in[i + j] : most[j];
  float result = *std::max_element(most, most + lanes);
  for (; i < count; ++i) result = std::max(result, in[i]);
  return result;
}

[[gnu::always_inline]] inline void round_body(const float* __restrict in, float gain, std::size_t count,
                                              std::uint8_t* __restrict bytes) {
  for (std::size_t i = 0; i < count; ++i)
    bytes[i] = static_cast<std::uint8_t>(static_cast<int>(in[i] * gain + 0.5F));
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] float largest_avx2(const float* in, std::size_t count) {
  return largest_body(in, count);
}
[[gnu::target("avx2")]] void round_avx2(const float* in, float gain, std::size_t count, std::uint8_t* bytes) {
  round_body(in, gain, count, bytes);
}
[[gnu::target("avx2,fma")]] void subtract_avx2(const std::uint8_t* bytes, std::size_t count, int level,
                                               float* out) {
  subtract_body(bytes, count, level, out);
}
[[gnu::target("avx2,fma")]] void subtract_three_avx2(const std::uint8_t* bytes, std::size_t count,
                                                     const std::uint8_t* level, float* out) {
  subtract_three_body(bytes, count, level, out);
}
[[gnu::target("avx2,fma")]] void add_avx2(const float* in, float weight, std::size_t count, float* out) {
  add_body(in, weight, count, out);
}
bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return has;
}
#endif

}  // namespace

void subtract_level(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* level, int period,
                    float* out) {
  const bool same = period == 1 || (level[0] == level[1] && level[1] == level[2]);
#if defined(__x86_64__)
  if (has_avx2()) {
    if (same)
      subtract_avx2(bytes, count, level[0], out);
    else
      subtract_three_avx2(bytes, count, level, out);
    return;
  }
#endif
  if (same)
    subtract_body(bytes, count, level[0], out);
  else
    subtract_three_body(bytes, count, level, out);
}

void add_weighted(const float* in, float weight, std::size_t count, float* out) {
#if defined(__x86_64__)
  if (has_avx2()) {
    add_avx2(in, weight, count, out);
    return;
  }
#endif
  add_body(in, weight, count, out);
}

float largest_of(const float* in, std::size_t count) {
#if defined(__x86_64__)
  if (has_avx2()) return largest_avx2(in, count);
#endif
  return largest_body(in, count);
}

void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes) {
#if defined(__x86_64__)
  if (has_avx2()) return round_avx2(in, gain, count, bytes);
#endif
  round_body(in, gain, count, bytes);
}

}  // namespace eigenpose
