#include "core/simd/window_kernels.h"

#include <algorithm>
#include <cstring>

#include <immintrin.h>

namespace eigenpose {

void raise_scores_portable(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                           std::span<const PlacedQuery> queries, std::int32_t* scores) {
  for (std::size_t g = 0; g < groups; ++g) {
    const std::int8_t* block = values + g * 256;
    for (const PlacedQuery& query : queries) {
      std::int32_t* row = scores + (query.index * groups + g) * 8;
      std::int32_t sums[8] = {};
      for (std::size_t k = 0; k < 8; ++k) {
        for (std::size_t v = 0; v < 8; ++v) {
          for (std::size_t i = 0; i < 4; ++i) {
            sums[v] += static_cast<std::int32_t>(query.values[k * 4 + i]) * block[k * 32 + v * 4 + i];
          }
        }
      }
      for (std::size_t v = 0; v < 8; ++v) {
        row[v] = std::max(row[v], sums[v] - biases[g * 8 + v] - query.penalty);
      }
    }
  }
}

namespace {

__attribute__((target("avx2"))) inline __m256i spread_four(const std::uint8_t* four) {
  std::int32_t value = 0;
  std::memcpy(&value, four, 4);
  return _mm256_set1_epi32(value);
}

__attribute__((target("avx2"))) void raise_scores_avx2(const std::int8_t* values, const std::int32_t* biases,
                                                       std::size_t groups,
                                                       std::span<const PlacedQuery> queries,
                                                       std::int32_t* scores) {
  const __m256i ones = _mm256_set1_epi16(1);
  for (std::size_t g = 0; g < groups; ++g) {
    // Eight views' windows stay in registers for all queries.
    const auto* block = reinterpret_cast<const __m256i*>(values + g * 256);
    const __m256i b0 = _mm256_loadu_si256(block);
    const __m256i b1 = _mm256_loadu_si256(block + 1);
    const __m256i b2 = _mm256_loadu_si256(block + 2);
    const __m256i b3 = _mm256_loadu_si256(block + 3);
    const __m256i b4 = _mm256_loadu_si256(block + 4);
    const __m256i b5 = _mm256_loadu_si256(block + 5);
    const __m256i b6 = _mm256_loadu_si256(block + 6);
    const __m256i b7 = _mm256_loadu_si256(block + 7);
    const __m256i bias = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(biases + g * 8));
    for (const PlacedQuery& query : queries) {
      const auto products = [&](int k, __m256i views) __attribute__((target("avx2"), always_inline)) {
        return _mm256_madd_epi16(_mm256_maddubs_epi16(spread_four(query.values + k * 4), views), ones);
      };
      const __m256i even = _mm256_add_epi32(_mm256_add_epi32(products(0, b0), products(2, b2)),
                                            _mm256_add_epi32(products(4, b4), products(6, b6)));
      const __m256i odd = _mm256_add_epi32(_mm256_add_epi32(products(1, b1), products(3, b3)),
                                           _mm256_add_epi32(products(5, b5), products(7, b7)));
      const __m256i cost = _mm256_add_epi32(bias, _mm256_set1_epi32(query.penalty));
      auto* best = reinterpret_cast<__m256i*>(scores + (query.index * groups + g) * 8);
      const __m256i score = _mm256_sub_epi32(_mm256_add_epi32(even, odd), cost);
      _mm256_storeu_si256(best, _mm256_max_epi32(_mm256_loadu_si256(best), score));
    }
  }
}

const auto chosen_raise = __builtin_cpu_supports("avx2") != 0 ? raise_scores_avx2 : raise_scores_portable;

}  // namespace

void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores) {
  chosen_raise(values, biases, groups, queries, scores);
}

}  // namespace eigenpose
