#include "core/simd/dense_kernels.h"

#include <immintrin.h>

namespace eigenpose {
namespace {

float dot_portable(const float* a, const float* b, int n) {
  float sums[8] = {};
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    for (int j = 0; j < 8; ++j) {
      sums[j] += a[i + j] * b[i + j];
    }
  }
  float sum = ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]));
  for (; i < n; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

__attribute__((target("avx2,fma"))) float horizontal_sum(__m256 v) {
  const __m128 low = _mm256_castps256_ps128(v);
  const __m128 high = _mm256_extractf128_ps(v, 1);
  __m128 sum = _mm_add_ps(low, high);
  sum = _mm_add_ps(sum, _mm_movehl_ps(sum, sum));
  sum = _mm_add_ss(sum, _mm_shuffle_ps(sum, sum, 1));
  return _mm_cvtss_f32(sum);
}

__attribute__((target("avx2,fma"))) float dot_avx2(const float* a, const float* b, int n) {
  __m256 s0 = _mm256_setzero_ps();
  __m256 s1 = _mm256_setzero_ps();
  __m256 s2 = _mm256_setzero_ps();
  __m256 s3 = _mm256_setzero_ps();
  int i = 0;
  for (; i + 32 <= n; i += 32) {
    s0 = _mm256_fmadd_ps(_mm256_loadu_ps(a + i), _mm256_loadu_ps(b + i), s0);
    s1 = _mm256_fmadd_ps(_mm256_loadu_ps(a + i + 8), _mm256_loadu_ps(b + i + 8), s1);
    s2 = _mm256_fmadd_ps(_mm256_loadu_ps(a + i + 16), _mm256_loadu_ps(b + i + 16), s2);
    s3 = _mm256_fmadd_ps(_mm256_loadu_ps(a + i + 24), _mm256_loadu_ps(b + i + 24), s3);
  }
  for (; i + 8 <= n; i += 8) {
    s0 = _mm256_fmadd_ps(_mm256_loadu_ps(a + i), _mm256_loadu_ps(b + i), s0);
  }
  float sum = horizontal_sum(_mm256_add_ps(_mm256_add_ps(s0, s1), _mm256_add_ps(s2, s3)));
  for (; i < n; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

void six_portable(const float* matrix, int rows, int columns, const float* vectors, float* out, int stride) {
  for (int k = 0; k < columns; ++k) {
    for (int v = 0; v < 6; ++v) {
      out[v * stride + k] =
          dot_portable(matrix + static_cast<long>(k) * rows, vectors + static_cast<long>(v) * rows, rows);
    }
  }
}

/// `Together` columns from `matrix` on, so that a vector's numbers are loaded once for them.
template <int Together>
__attribute__((target("avx2,fma"))) inline void six_columns_avx2(const float* matrix, int rows,
                                                                 const float* vectors, float* out,
                                                                 int stride) {
  __m256 sums[Together][6];
  for (auto& column : sums) {
    for (__m256& sum : column) {
      sum = _mm256_setzero_ps();
    }
  }
  int i = 0;
  for (; i + 8 <= rows; i += 8) {
    __m256 m[Together];
    for (int k = 0; k < Together; ++k) {
      m[k] = _mm256_loadu_ps(matrix + static_cast<long>(k) * rows + i);
    }
    for (int v = 0; v < 6; ++v) {
      const __m256 vector = _mm256_loadu_ps(vectors + static_cast<long>(v) * rows + i);
      for (int k = 0; k < Together; ++k) {
        sums[k][v] = _mm256_fmadd_ps(m[k], vector, sums[k][v]);
      }
    }
  }
  for (int k = 0; k < Together; ++k) {
    for (int v = 0; v < 6; ++v) {
      float sum = horizontal_sum(sums[k][v]);
      for (int rest = i; rest < rows; ++rest) {
        sum += matrix[static_cast<long>(k) * rows + rest] * vectors[static_cast<long>(v) * rows + rest];
      }
      out[v * stride + k] = sum;
    }
  }
}

__attribute__((target("avx2,fma"))) void six_avx2(const float* matrix, int rows, int columns,
                                                  const float* vectors, float* out, int stride) {
  int k = 0;
  for (; k + 2 <= columns; k += 2) {
    six_columns_avx2<2>(matrix + static_cast<long>(k) * rows, rows, vectors, out + k, stride);
  }
  if (k < columns) {
    six_columns_avx2<1>(matrix + static_cast<long>(k) * rows, rows, vectors, out + k, stride);
  }
}

void residual_portable(const float* point, const float* frame, int n, float& squared, float* products) {
  squared = 0.0F;
  for (int v = 0; v < 5; ++v) {
    products[v] = 0.0F;
  }
  for (int i = 0; i < n; ++i) {
    const float r = point[i] - frame[i];
    squared += r * r;
    for (int v = 0; v < 5; ++v) {
      products[v] += r * frame[(v + 1) * n + i];
    }
  }
}

__attribute__((target("avx2,fma"))) void residual_avx2(const float* point, const float* frame, int n,
                                                       float& squared, float* products) {
  __m256 sums[6];
  for (__m256& sum : sums) {
    sum = _mm256_setzero_ps();
  }
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    const __m256 r = _mm256_sub_ps(_mm256_loadu_ps(point + i), _mm256_loadu_ps(frame + i));
    sums[0] = _mm256_fmadd_ps(r, r, sums[0]);
    for (int v = 1; v < 6; ++v) {
      sums[v] = _mm256_fmadd_ps(r, _mm256_loadu_ps(frame + v * n + i), sums[v]);
    }
  }
  squared = horizontal_sum(sums[0]);
  for (int v = 0; v < 5; ++v) {
    products[v] = horizontal_sum(sums[v + 1]);
  }
  for (; i < n; ++i) {
    const float r = point[i] - frame[i];
    squared += r * r;
    for (int v = 0; v < 5; ++v) {
      products[v] += r * frame[(v + 1) * n + i];
    }
  }
}

const bool wide = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
const auto chosen_six = wide ? six_avx2 : six_portable;
const auto chosen_residual = wide ? residual_avx2 : residual_portable;

using Dot = float (*)(const float*, const float*, int);
const Dot chosen_dot = wide ? dot_avx2 : dot_portable;

}  // namespace

float dot(const float* a, const float* b, int n) {
  return chosen_dot(a, b, n);
}

void multiply_transposed(const float* matrix, int rows, int columns, const float* vector, float* out) {
  for (int k = 0; k < columns; ++k) {
    out[k] = chosen_dot(matrix + static_cast<long>(k) * rows, vector, rows);
  }
}

void multiply_transposed_six(const float* matrix, int rows, int columns, const float* vectors, float* out,
                             int stride) {
  chosen_six(matrix, rows, columns, vectors, out, stride);
}

void residual_products(const float* point, const float* frame, int n, float& squared, float* products) {
  chosen_residual(point, frame, n, squared, products);
}

}  // namespace eigenpose
