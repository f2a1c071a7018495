#include "core/image/resize_kernels.h"

#include <algorithm>

namespace eigenpose {
namespace {

// One body, compiled once for every instruction set. This file is compiled with loop vectorisation on.
[[gnu::always_inline]] inline void subtract_body(const std::uint8_t* bytes, std::size_t count, int level,
                                                 float* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<float>(std::max(0, bytes[i] - level));
}

[[gnu::always_inline]] inline void subtract_three_body(const std::uint8_t* bytes, std::size_t count,
                                                       const std::uint8_t* level, float* out) {
  const int l0 = level[0];
  const int l1 = level[1];
  const int l2 = level[2];
  for (std::size_t i = 0; i + 2 < count; i += 3) {
    out[i] = static_cast<float>(std::max(0, bytes[i] - l0));
    out[i + 1] = static_cast<float>(std::max(0, bytes[i + 1] - l1));
    out[i + 2] = static_cast<float>(std::max(0, bytes[i + 2] - l2));
  }
}

[[gnu::always_inline]] inline void add_body(const float* __restrict in, float weight, std::size_t count,
                                            float* __restrict out) {
  for (std::size_t i = 0; i < count; ++i) out[i] += weight * in[i];
}

#if defined(__x86_64__)
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

}  // namespace eigenpose
