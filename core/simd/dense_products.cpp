#include "core/simd/dense_products.h"

#include <cstddef>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/dense_products.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using V = hn::Vec<F>;
constexpr int lanes = static_cast<int>(hn::MaxLanes(F()));

HWY_INLINE const float* column_of(const float* matrix, int rows, int column) {
  return matrix + static_cast<std::ptrdiff_t>(column) * rows;
}

float dot(const float* a, const float* b, int n) {
  const F d;
  V sums[4];
  unroll<4>([&](auto s) EIGENPOSE_INLINE_LAMBDA { sums[s] = hn::Zero(d); });
  int i = 0;
  for (; i + 4 * lanes <= n; i += 4 * lanes) {
    unroll<4>([&](auto s) EIGENPOSE_INLINE_LAMBDA {
      constexpr int at = static_cast<int>(s) * lanes;
      sums[s] = hn::MulAdd(hn::LoadU(d, a + i + at), hn::LoadU(d, b + i + at), sums[s]);
    });
  }
  for (; i + lanes <= n; i += lanes) sums[0] = hn::MulAdd(hn::LoadU(d, a + i), hn::LoadU(d, b + i), sums[0]);
  float sum = hn::GetLane(hn::SumOfLanes(d, hn::Add(hn::Add(sums[0], sums[1]), hn::Add(sums[2], sums[3]))));
  for (; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

void multiply_transposed(const float* matrix, int rows, int columns, const float* vector, float* out) {
  for (int k = 0; k < columns; ++k) out[k] = dot(column_of(matrix, rows, k), vector, rows);
}

/// `together` columns from `matrix` on, so that each vector is loaded once for them.
template <int together>
HWY_INLINE void six_products(const float* matrix, int rows, const float* vectors, float* out, int stride) {
  const F d;
  V sums[together][6];
  unroll<together>([&](auto k) EIGENPOSE_INLINE_LAMBDA {
    unroll<6>([&](auto v) EIGENPOSE_INLINE_LAMBDA { sums[k][v] = hn::Zero(d); });
  });
  int i = 0;
  for (; i + lanes <= rows; i += lanes) {
    V m[together];
    unroll<together>([&](auto k) EIGENPOSE_INLINE_LAMBDA {
      m[k] = hn::LoadU(d, column_of(matrix, rows, static_cast<int>(k)) + i);
    });
    unroll<6>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
      const V vector = hn::LoadU(d, column_of(vectors, rows, static_cast<int>(v)) + i);
      unroll<together>([&](auto k)
                           EIGENPOSE_INLINE_LAMBDA { sums[k][v] = hn::MulAdd(m[k], vector, sums[k][v]); });
    });
  }
  for (int k = 0; k < together; ++k) {
    for (int v = 0; v < 6; ++v) {
      float sum = hn::GetLane(hn::SumOfLanes(d, sums[k][v]));
      for (int rest = i; rest < rows; ++rest)
        sum += column_of(matrix, rows, k)[rest] * column_of(vectors, rows, v)[rest];
      out[v * stride + k] = sum;
    }
  }
}

void multiply_transposed_six(const float* matrix, int rows, int columns, const float* vectors, float* out,
                             int stride) {
  int k = 0;
  for (; k + 2 <= columns; k += 2)
    six_products<2>(column_of(matrix, rows, k), rows, vectors, out + k, stride);
  if (k < columns) six_products<1>(column_of(matrix, rows, k), rows, vectors, out + k, stride);
}

void residual_products(const float* point, const float* frame, int n, float& squared, float* products) {
  const F d;
  V sums[6];
  unroll<6>([&](auto v) EIGENPOSE_INLINE_LAMBDA { sums[v] = hn::Zero(d); });
  int i = 0;
  for (; i + lanes <= n; i += lanes) {
    const V r = hn::Sub(hn::LoadU(d, point + i), hn::LoadU(d, frame + i));
    sums[0] = hn::MulAdd(r, r, sums[0]);
    unroll<5>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
      const float* derivative = column_of(frame, n, static_cast<int>(v) + 1);
      sums[v + 1] = hn::MulAdd(r, hn::LoadU(d, derivative + i), sums[v + 1]);
    });
  }
  squared = hn::GetLane(hn::SumOfLanes(d, sums[0]));
  for (int v = 0; v < 5; ++v) products[v] = hn::GetLane(hn::SumOfLanes(d, sums[v + 1]));
  for (; i < n; ++i) {
    const float r = point[i] - frame[i];
    squared += r * r;
    for (int v = 0; v < 5; ++v) products[v] += r * column_of(frame, n, v + 1)[i];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(dot);
HWY_EXPORT(multiply_transposed);
HWY_EXPORT(multiply_transposed_six);
HWY_EXPORT(residual_products);

float dot(const float* a, const float* b, int n) {
  return HWY_DYNAMIC_DISPATCH(dot)(a, b, n);
}

void multiply_transposed(const float* matrix, int rows, int columns, const float* vector, float* out) {
  HWY_DYNAMIC_DISPATCH(multiply_transposed)(matrix, rows, columns, vector, out);
}

void multiply_transposed_six(const float* matrix, int rows, int columns, const float* vectors, float* out,
                             int stride) {
  HWY_DYNAMIC_DISPATCH(multiply_transposed_six)(matrix, rows, columns, vectors, out, stride);
}

void residual_products(const float* point, const float* frame, int n, float& squared, float* products) {
  HWY_DYNAMIC_DISPATCH(residual_products)(point, frame, n, squared, products);
}

}  // namespace eigenpose
#endif
