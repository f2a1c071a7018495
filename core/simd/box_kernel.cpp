#include <immintrin.h>

#include "core/simd/box_kernel_body.h"
#include "core/simd/box_kernels.h"

namespace eigenpose {

std::uint32_t box_kernel_avx2(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                              bool ordered, BoxDistances& distances);

namespace {

struct Sse2 {
  using Vector = __m128;
  static Vector all(float value) { return _mm_set1_ps(value); }
  static Vector larger(Vector a, Vector b) { return _mm_max_ps(a, b); }
  static std::uint32_t within(Vector a, Vector bound) {
    return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_cmple_ps(a, bound)));
  }
};

std::uint32_t box_kernel_baseline(const BoxSlice* slices, const float* point, std::size_t dimensions,
                                  float bound, bool ordered, BoxDistances& distances) {
  return ordered ? BoxBody<Sse2>::run<true>(slices, point, dimensions, bound, distances)
                 : BoxBody<Sse2>::run<false>(slices, point, dimensions, bound, distances);
}

}  // namespace

std::vector<NamedBoxKernel> box_kernels() {
  std::vector<NamedBoxKernel> kernels = {{"baseline", box_kernel_baseline}};
  if (__builtin_cpu_supports("avx2")) kernels.push_back({"avx2", box_kernel_avx2});
  return kernels;
}

BoxKernel box_kernel() {
  return box_kernels().back().kernel;
}

}  // namespace eigenpose
