#include "core/simd/projection.h"

#include <algorithm>
#include <cstddef>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/projection.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using V = hn::Vec<F>;
constexpr std::size_t lanes = hn::MaxLanes(F());
/// Rows of four columns of the basis that stay in the first-level cache while all appearances pass.
constexpr std::size_t block_rows = 512;
static_assert(block_rows % lanes == 0);

/// `together` neighbouring columns share each load of x; `out` points to the first of their components.
template <std::size_t together>
HWY_INLINE void project_columns(const float* columns, std::size_t rows, const float* x, std::size_t count,
                                float* out, std::size_t stride) {
  const F d;
  const std::size_t whole = rows / lanes * lanes;
  V sums[most_projected][together];
  for (auto& of_appearance : sums)
    unroll<together>([&](auto j) EIGENPOSE_INLINE_LAMBDA { of_appearance[j] = hn::Zero(d); });
  for (std::size_t first = 0; first < whole; first += block_rows) {
    const std::size_t last = std::min(whole, first + block_rows);
    for (std::size_t n = 0; n < count; ++n) {
      const float* vector = x + n * rows;
      V s[together];
      unroll<together>([&](auto j) EIGENPOSE_INLINE_LAMBDA { s[j] = sums[n][j]; });
      for (std::size_t i = first; i < last; i += lanes) {
        const V v = hn::LoadU(d, vector + i);
        unroll<together>([&](auto j) EIGENPOSE_INLINE_LAMBDA {
          s[j] = hn::MulAdd(hn::LoadU(d, columns + j * rows + i), v, s[j]);
        });
      }
      unroll<together>([&](auto j) EIGENPOSE_INLINE_LAMBDA { sums[n][j] = s[j]; });
    }
  }
  for (std::size_t n = 0; n < count; ++n) {
    const float* vector = x + n * rows;
    for (std::size_t j = 0; j < together; ++j) {
      float sum = hn::GetLane(hn::SumOfLanes(d, sums[n][j]));
      for (std::size_t i = whole; i < rows; ++i) sum += columns[j * rows + i] * vector[i];
      out[n * stride + j] = sum;
    }
  }
}

/// Columns of `rows` floats: `cols` of the basis, `count` of x; `out` has `count` columns of `cols` floats.
void project_all(const float* basis, std::size_t rows, std::size_t cols, const float* x, std::size_t count,
                 float* out) {
  std::size_t k = 0;
  for (; k + 4 <= cols; k += 4) project_columns<4>(basis + k * rows, rows, x, count, out + k, cols);
  for (; k < cols; ++k) project_columns<1>(basis + k * rows, rows, x, count, out + k, cols);
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(project_all);

void project_onto(const Eigen::MatrixXf& basis, const Eigen::VectorXf& x, Eigen::Ref<Eigen::VectorXf> out) {
  HWY_DYNAMIC_DISPATCH(project_all)
  (basis.data(), static_cast<std::size_t>(basis.rows()), static_cast<std::size_t>(basis.cols()), x.data(), 1,
   out.data());
}

void project_onto(const Eigen::MatrixXf& basis, const Eigen::MatrixXf& x, Eigen::Index count,
                  Eigen::MatrixXf& out) {
  HWY_DYNAMIC_DISPATCH(project_all)
  (basis.data(), static_cast<std::size_t>(basis.rows()), static_cast<std::size_t>(basis.cols()), x.data(),
   static_cast<std::size_t>(count), out.data());
}

}  // namespace eigenpose
#endif
