// Everything below is compiled for AVX2, without FMA. No library code may be included here: an inline
// function of it might be the one copy that the linker keeps for all processors.
#pragma GCC target("avx2")

#include <immintrin.h>

#include "core/simd/box_kernel_body.h"

namespace eigenpose {

namespace {

struct Avx2 {
  using Vector = __m256;
  static Vector all(float value) { return _mm256_set1_ps(value); }
  static Vector larger(Vector a, Vector b) { return _mm256_max_ps(a, b); }
  static std::uint32_t within(Vector a, Vector bound) {
    return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a, bound, _CMP_LE_OQ)));
  }
};

}  // namespace

std::uint32_t box_kernel_avx2(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                              bool ordered, BoxDistances& distances);

std::uint32_t box_kernel_avx2(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                              bool ordered, BoxDistances& distances) {
  return ordered ? BoxBody<Avx2>::run<true>(slices, point, dimensions, bound, distances)
                 : BoxBody<Avx2>::run<false>(slices, point, dimensions, bound, distances);
}

}  // namespace eigenpose
