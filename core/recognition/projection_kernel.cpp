#include "core/recognition/projection_kernel.h"

#include <cstddef>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eigenpose {
namespace {

#if defined(__x86_64__)

[[gnu::target("avx2,fma")]] float sum_of(__m256 v) {
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)));
}

/// Four columns share each load of x.
[[gnu::target("avx2,fma")]] void project_avx2(const float* basis, std::size_t rows, std::size_t cols,
                                              const float* x, float* out) {
  std::size_t k = 0;
  for (; k + 4 <= cols; k += 4) {
    const float* c0 = basis + k * rows;
    const float* c1 = c0 + rows;
    const float* c2 = c1 + rows;
    const float* c3 = c2 + rows;
    __m256 s0 = _mm256_setzero_ps();
    __m256 s1 = s0;
    __m256 s2 = s0;
    __m256 s3 = s0;
    std::size_t i = 0;
    for (; i + 8 <= rows; i += 8) {
      const __m256 v = _mm256_loadu_ps(x + i);
      s0 = _mm256_fmadd_ps(_mm256_loadu_ps(c0 + i), v, s0);
      s1 = _mm256_fmadd_ps(_mm256_loadu_ps(c1 + i), v, s1);
      s2 = _mm256_fmadd_ps(_mm256_loadu_ps(c2 + i), v, s2);
      s3 = _mm256_fmadd_ps(_mm256_loadu_ps(c3 + i), v, s3);
    }
    out[k] = sum_of(s0);
    out[k + 1] = sum_of(s1);
    out[k + 2] = sum_of(s2);
    out[k + 3] = sum_of(s3);
    for (; i < rows; ++i) {
      out[k] += c0[i] * x[i];
      out[k + 1] += c1[i] * x[i];
      out[k + 2] += c2[i] * x[i];
      out[k + 3] += c3[i] * x[i];
    }
  }
  for (; k < cols; ++k) {
    const float* column = basis + k * rows;
    __m256 sum = _mm256_setzero_ps();
    std::size_t i = 0;
    for (; i + 8 <= rows; i += 8)
      sum = _mm256_fmadd_ps(_mm256_loadu_ps(column + i), _mm256_loadu_ps(x + i), sum);
    out[k] = sum_of(sum);
    for (; i < rows; ++i) out[k] += column[i] * x[i];
  }
}

bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return has;
}

#endif

}  // namespace

void project_onto(const Eigen::MatrixXf& basis, const Eigen::VectorXf& x, Eigen::Ref<Eigen::VectorXf> out) {
#if defined(__x86_64__)
  if (has_avx2()) {
    project_avx2(basis.data(), static_cast<std::size_t>(basis.rows()), static_cast<std::size_t>(basis.cols()),
                 x.data(), out.data());
    return;
  }
#endif
  out.noalias() = basis.transpose() * x;
}

}  // namespace eigenpose
