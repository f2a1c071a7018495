#include "core/parts/window_kernels.h"

#include <algorithm>
#include <cstring>

#include <immintrin.h>

namespace eigenpose {

void raise_scores_portable(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                           const std::uint8_t* query, std::int32_t penalty, std::int32_t* scores) {
  for (std::size_t g = 0; g < groups; ++g) {
    std::int32_t sums[8] = {};
    const std::int8_t* block = values + g * 256;
    for (std::size_t k = 0; k < 8; ++k) {
      for (std::size_t v = 0; v < 8; ++v) {
        for (std::size_t i = 0; i < 4; ++i) {
          sums[v] += static_cast<std::int32_t>(query[k * 4 + i]) * block[k * 32 + v * 4 + i];
        }
      }
    }
    for (std::size_t v = 0; v < 8; ++v) {
      scores[g * 8 + v] = std::max(scores[g * 8 + v], sums[v] - biases[g * 8 + v] - penalty);
    }
  }
}

namespace {

__attribute__((target("avx2"))) void raise_scores_avx2(const std::int8_t* values, const std::int32_t* biases,
                                                       std::size_t groups, const std::uint8_t* query,
                                                       std::int32_t penalty, std::int32_t* scores) {
  const __m256i ones = _mm256_set1_epi16(1);
  const __m256i cost = _mm256_set1_epi32(penalty);
  __m256i q[8];
  for (int k = 0; k < 8; ++k) {
    std::int32_t four = 0;
    std::memcpy(&four, query + k * 4, 4);
    q[k] = _mm256_set1_epi32(four);
  }
  for (std::size_t g = 0; g < groups; ++g) {
    const auto* block = reinterpret_cast<const __m256i*>(values + g * 256);
    __m256i even = _mm256_setzero_si256();
    __m256i odd = _mm256_setzero_si256();
    for (int k = 0; k < 8; k += 2) {
      even = _mm256_add_epi32(
          even, _mm256_madd_epi16(_mm256_maddubs_epi16(q[k], _mm256_loadu_si256(block + k)), ones));
      odd = _mm256_add_epi32(
          odd, _mm256_madd_epi16(_mm256_maddubs_epi16(q[k + 1], _mm256_loadu_si256(block + k + 1)), ones));
    }
    const __m256i bias = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(biases + g * 8));
    auto* best = reinterpret_cast<__m256i*>(scores + g * 8);
    const __m256i score = _mm256_sub_epi32(_mm256_add_epi32(even, odd), _mm256_add_epi32(bias, cost));
    _mm256_storeu_si256(best, _mm256_max_epi32(_mm256_loadu_si256(best), score));
  }
}

using Raise = void (*)(const std::int8_t*, const std::int32_t*, std::size_t, const std::uint8_t*,
                       std::int32_t, std::int32_t*);
const Raise chosen_raise = __builtin_cpu_supports("avx2") != 0 ? raise_scores_avx2 : raise_scores_portable;

}  // namespace

void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  const std::uint8_t* query, std::int32_t penalty, std::int32_t* scores) {
  chosen_raise(values, biases, groups, query, penalty, scores);
}

}  // namespace eigenpose
