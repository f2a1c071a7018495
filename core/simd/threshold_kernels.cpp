#include "core/simd/threshold_kernels.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eigenpose {
namespace {

/// Pixels [first, width), first a multiple of 64.
void threshold_from(const std::uint8_t* row, int first, int width, int bands, std::uint8_t threshold,
                    std::uint64_t* bits) {
  for (int x = first; x < width; x += 64) {
    std::uint64_t word = 0;
    for (int i = 0; i < 64 && x + i < width; ++i) {
      bool above = false;
      for (int b = 0; b < bands; ++b) above |= row[(x + i) * bands + b] > threshold;
      word |= static_cast<std::uint64_t>(above) << i;
    }
    bits[x / 64] = word;
  }
}

#if defined(__x86_64__)

/// Bits of 64 bytes: above threshold or not. v > t ⇔ max(v, t+1) = v.
__attribute__((target("avx2"))) inline std::uint64_t above_64(const std::uint8_t* bytes, __m256i least) {
  const __m256i low = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes));
  const __m256i high = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes + 32));
  const auto low_bits =
      static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(_mm256_max_epu8(low, least), low)));
  const auto high_bits =
      static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(_mm256_max_epu8(high, least), high)));
  return low_bits | (static_cast<std::uint64_t>(high_bits) << 32);
}

__attribute__((target("avx2,bmi2"))) void threshold_row_avx2(const std::uint8_t* row, int width, int bands,
                                                             std::uint8_t threshold, std::uint64_t* bits) {
  const __m256i least = _mm256_set1_epi8(static_cast<char>(threshold + 1));
  int x = 0;
  if (bands == 1) {
    for (; x + 64 <= width; x += 64) bits[x / 64] = above_64(row + x, least);
  } else {
    for (; x + 64 <= width; x += 64) {
      const std::uint8_t* bytes = row + 3 * static_cast<std::ptrdiff_t>(x);
      const std::uint64_t w0 = above_64(bytes, least);
      const std::uint64_t w1 = above_64(bytes + 64, least);
      const std::uint64_t w2 = above_64(bytes + 128, least);
      // Each bit joined by the next two, then every third one picked; 64 and 128 are 1 and 2 modulo 3.
      const std::uint64_t any0 = w0 | (w0 >> 1) | (w1 << 63) | (w0 >> 2) | (w1 << 62);
      const std::uint64_t any1 = w1 | (w1 >> 1) | (w2 << 63) | (w1 >> 2) | (w2 << 62);
      const std::uint64_t any2 = w2 | (w2 >> 1) | (w2 >> 2);
      bits[x / 64] = _pext_u64(any0, 0x9249249249249249U) | (_pext_u64(any1, 0x4924924924924924U) << 22) |
                     (_pext_u64(any2, 0x2492492492492492U) << 43);
    }
  }
  threshold_from(row, x, width, bands, threshold, bits);
}

bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("bmi2") != 0;
  return has;
}

#endif

}  // namespace

void threshold_row_plain(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                         std::uint64_t* bits) {
  threshold_from(row, 0, width, bands, threshold, bits);
}

void threshold_row(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                   std::uint64_t* bits) {
#if defined(__x86_64__)
  if (threshold < 255 && has_avx2()) {
    threshold_row_avx2(row, width, bands, threshold, bits);
    return;
  }
#endif
  threshold_from(row, 0, width, bands, threshold, bits);
}

}  // namespace eigenpose
