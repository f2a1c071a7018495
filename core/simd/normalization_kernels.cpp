#include "core/simd/normalization_kernels.h"

#include <algorithm>

namespace eigenpose {
namespace {

// One body, compiled once for every instruction set. This file is compiled with loop vectorisation on.
[[gnu::always_inline]] inline void add_above_body(const std::uint8_t* __restrict bytes, std::size_t count,
                                                  const std::uint8_t* __restrict levels, float weight,
                                                  float* __restrict out) {
  std::uint8_t above[level_block];
  std::size_t i = 0;
  for (; i + level_block <= count; i += level_block) {
    for (std::size_t j = 0; j < level_block; ++j) {
      const std::uint8_t byte = bytes[i + j];
      above[j] = static_cast<std::uint8_t>((byte > levels[j] ? byte : levels[j]) - levels[j]);
    }
    for (std::size_t j = 0; j < level_block; ++j) out[i + j] += weight * static_cast<float>(above[j]);
  }
  for (; i < count; ++i)
    out[i] += weight * static_cast<float>(std::max(0, bytes[i] - levels[i % level_block]));
}

[[gnu::always_inline]] inline float energy_body(const float* in, std::size_t count) {
  constexpr std::size_t lanes = 32;
  float sums[lanes] = {};
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    for (std::size_t j = 0; j < lanes; ++j) sums[j] += in[i + j] * in[i + j];
  double result = 0.0;
  for (const float sum : sums) result += sum;
  for (; i < count; ++i) result += static_cast<double>(in[i]) * in[i];
  return static_cast<float>(result);
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
  constexpr float half = 0.5F;  // of numbers ≥ 0, and done for many at once
  for (std::size_t i = 0; i < count; ++i) {
    const float rounded = in[i] * gain + half;
    bytes[i] = static_cast<std::uint8_t>(static_cast<int>(rounded));
  }
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] float largest_avx2(const float* in, std::size_t count) {
  return largest_body(in, count);
}
[[gnu::target("avx2")]] void round_avx2(const float* in, float gain, std::size_t count, std::uint8_t* bytes) {
  round_body(in, gain, count, bytes);
}
[[gnu::target("avx2,fma")]] float energy_avx2(const float* in, std::size_t count) {
  return energy_body(in, count);
}
[[gnu::target("avx2,fma")]] void add_above_avx2(const std::uint8_t* bytes, std::size_t count,
                                                const std::uint8_t* levels, float weight, float* out) {
  add_above_body(bytes, count, levels, weight, out);
}
bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return has;
}
#endif

}  // namespace

void add_above_levels(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* levels, float weight,
                      float* out) {
#if defined(__x86_64__)
  if (has_avx2()) {
    add_above_avx2(bytes, count, levels, weight, out);
    return;
  }
#endif
  add_above_body(bytes, count, levels, weight, out);
}

float energy_of(const float* in, std::size_t count) {
#if defined(__x86_64__)
  if (has_avx2()) return energy_avx2(in, count);
#endif
  return energy_body(in, count);
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
