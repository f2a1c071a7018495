#include "core/simd/projection_kernel.h"

#include <algorithm>
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

/// So many rows of four columns of the basis stay in the first cache while all appearances pass.
constexpr std::size_t block_rows = 512;

/// Four columns share each load of x.
[[gnu::target("avx2,fma")]] void project_avx2(const float* basis, std::size_t rows, std::size_t cols,
                                              const float* x, std::size_t count, float* out) {
  const std::size_t even_rows = rows / 8 * 8;
  std::size_t k = 0;
  for (; k + 4 <= cols; k += 4) {
    const float* c0 = basis + k * rows;
    const float* c1 = c0 + rows;
    const float* c2 = c1 + rows;
    const float* c3 = c2 + rows;
    __m256 sums[most_projected][4] = {};
    for (std::size_t first = 0; first < even_rows; first += block_rows) {
      const std::size_t last = std::min(even_rows, first + block_rows);
      for (std::size_t n = 0; n < count; ++n) {
        const float* vector = x + n * rows;
        __m256 s0 = sums[n][0];
        __m256 s1 = sums[n][1];
        __m256 s2 = sums[n][2];
        __m256 s3 = sums[n][3];
        for (std::size_t i = first; i < last; i += 8) {
          const __m256 v = _mm256_loadu_ps(vector + i);
          s0 = _mm256_fmadd_ps(_mm256_loadu_ps(c0 + i), v, s0);
          s1 = _mm256_fmadd_ps(_mm256_loadu_ps(c1 + i), v, s1);
          s2 = _mm256_fmadd_ps(_mm256_loadu_ps(c2 + i), v, s2);
          s3 = _mm256_fmadd_ps(_mm256_loadu_ps(c3 + i), v, s3);
        }
        sums[n][0] = s0;
        sums[n][1] = s1;
        sums[n][2] = s2;
        sums[n][3] = s3;
      }
    }
    for (std::size_t n = 0; n < count; ++n) {
      const float* vector = x + n * rows;
      for (std::size_t j = 0; j < 4; ++j) {
        float& sum = out[n * cols + k + j] = sum_of(sums[n][j]);
        for (std::size_t i = even_rows; i < rows; ++i) sum += c0[j * rows + i] * vector[i];
      }
    }
  }
  for (; k < cols; ++k) {
    const float* column = basis + k * rows;
    for (std::size_t n = 0; n < count; ++n) {
      const float* vector = x + n * rows;
      __m256 total = _mm256_setzero_ps();
      for (std::size_t i = 0; i < even_rows; i += 8)
        total = _mm256_fmadd_ps(_mm256_loadu_ps(column + i), _mm256_loadu_ps(vector + i), total);
      float& sum = out[n * cols + k] = sum_of(total);
      for (std::size_t i = even_rows; i < rows; ++i) sum += column[i] * vector[i];
    }
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
                 x.data(), 1, out.data());
    return;
  }
#endif
  out.noalias() = basis.transpose() * x;
}

void project_onto(const Eigen::MatrixXf& basis, const Eigen::MatrixXf& x, Eigen::Index count,
                  Eigen::MatrixXf& out) {
#if defined(__x86_64__)
  if (has_avx2()) {
    project_avx2(basis.data(), static_cast<std::size_t>(basis.rows()), static_cast<std::size_t>(basis.cols()),
                 x.data(), static_cast<std::size_t>(count), out.data());
    return;
  }
#endif
  for (Eigen::Index n = 0; n < count; ++n) out.col(n).noalias() = basis.transpose() * x.col(n);
}

}  // namespace eigenpose
