#include "core/simd/gram_products.h"

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/gram_products.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void widen_bytes(const std::uint8_t* bytes, std::size_t n, std::int16_t* words) {
  const hn::ScalableTag<std::int16_t> d;
  const hn::Rebind<std::uint8_t, decltype(d)> d_bytes;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  std::size_t k = 0;
  for (; k + lanes <= n; k += lanes)
    hn::StoreU(hn::PromoteTo(d, hn::LoadU(d_bytes, bytes + k)), d, words + k);
  for (; k < n; ++k) words[k] = bytes[k];
}

/// Calls tile(rows, columns, i, j) for every tile of an m × n matrix: of 3 × 4 entries where they fit, of
/// single entries at the edges.
template <class Tile>
HWY_INLINE void for_each_tile(std::size_t m, std::size_t n, const Tile& tile) {
  using One = std::integral_constant<std::size_t, 1>;
  using Three = std::integral_constant<std::size_t, 3>;
  using Four = std::integral_constant<std::size_t, 4>;
  const std::size_t whole_m = m - m % 3;
  const std::size_t whole_n = n - n % 4;
  for (std::size_t j = 0; j < whole_n; j += 4)
    for (std::size_t i = 0; i < whole_m; i += 3) tile(Three(), Four(), i, j);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = i < whole_m ? whole_n : 0; j < n; ++j) tile(One(), One(), i, j);
}

#if HWY_TARGET == HWY_SCALAR

template <std::size_t m, std::size_t n>
HWY_INLINE void add_word_tile(const std::int16_t* a, std::size_t lda, const std::int16_t* b, std::size_t ldb,
                              std::size_t length, const Sums<std::int64_t>& out) {
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      std::int32_t sum = 0;
      for (std::size_t k = 0; k < length; ++k)
        sum += static_cast<std::int32_t>(a[i * lda + k]) * b[j * ldb + k];
      out.data[i * out.stride + j] += sum;
    }
  }
}

#else

using Words = hn::ScalableTag<std::int16_t>;
using Quads = hn::RepartitionToWide<Words>;
using QuadVector = hn::Vec<Quads>;

/// The totals of four vectors, to four neighbouring outputs. Each total fits 31 bits.
HWY_INLINE void add_four_totals(const QuadVector (&sums)[4], std::int64_t* out) {
  const Quads d;
  const hn::RepartitionToWide<Quads> d64;
  // In each block of 128 bits: (0, 1) and (2, 3) added crosswise, then both; leaves the totals of the block.
  const QuadVector first =
      hn::Add(hn::InterleaveLower(d, sums[0], sums[1]), hn::InterleaveUpper(d, sums[0], sums[1]));
  const QuadVector second =
      hn::Add(hn::InterleaveLower(d, sums[2], sums[3]), hn::InterleaveUpper(d, sums[2], sums[3]));
  const auto low = hn::BitCast(d64, first);
  const auto high = hn::BitCast(d64, second);
  const QuadVector totals = hn::Add(hn::BitCast(d, hn::InterleaveLower(d64, low, high)),
                                    hn::BitCast(d, hn::InterleaveUpper(d64, low, high)));
  const auto add = [&](auto d_out, auto four_or_two, std::int64_t* to) EIGENPOSE_INLINE_LAMBDA {
    hn::StoreU(hn::Add(hn::LoadU(d_out, to), hn::PromoteTo(d_out, four_or_two)), d_out, to);
  };
  const hn::Half<Quads> half;
  if constexpr (hn::MaxLanes(d) == 8) {
    add(d64, hn::Add(hn::LowerHalf(half, totals), hn::UpperHalf(half, totals)), out);
  } else {
    add(d64, hn::LowerHalf(half, totals), out);
    add(d64, hn::UpperHalf(half, totals), out + 2);
  }
}

/// Unsigned bytes times unsigned bytes need 16-bit operands: what multiplies bytes takes one side as signed
/// and saturates. 3 × 4 sums, three operands and one in flight fill sixteen registers.
template <std::size_t m, std::size_t n>
HWY_INLINE void add_word_tile(const std::int16_t* a, std::size_t lda, const std::int16_t* b, std::size_t ldb,
                              std::size_t length, const Sums<std::int64_t>& out) {
  const Words d;
  const Quads d32;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  QuadVector sums[m][n];
  QuadVector more[m][n];  // some targets split the products over two sums
  unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA {
    unroll<n>([&](auto j) EIGENPOSE_INLINE_LAMBDA { sums[i][j] = more[i][j] = hn::Zero(d32); });
  });
  std::size_t k = 0;
  for (; k + lanes <= length; k += lanes) {
    hn::Vec<Words> x[m];
    unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA { x[i] = hn::LoadU(d, a + i * lda + k); });
    unroll<n>([&](auto j) EIGENPOSE_INLINE_LAMBDA {
      const auto y = hn::LoadU(d, b + j * ldb + k);
      unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA {
        sums[i][j] = hn::ReorderWidenMulAccumulate(d32, x[i], y, sums[i][j], more[i][j]);
      });
    });
  }
  unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA {
    unroll<n>([&](auto j) EIGENPOSE_INLINE_LAMBDA { sums[i][j] = hn::Add(sums[i][j], more[i][j]); });
    std::int64_t* row = out.data + i * out.stride;
    if constexpr (n == 4) {
      add_four_totals(sums[i], row);
    } else {
      static_assert(n == 1);
      row[0] += hn::GetLane(hn::SumOfLanes(d32, sums[i][0]));
    }
    if (k == length) return;
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t rest = k; rest < length; ++rest)
        row[j] += static_cast<std::int32_t>(a[i * lda + rest]) * b[j * ldb + rest];
  });
}

#endif

void add_word_products(const Rows<std::int16_t>& a, const Rows<std::int16_t>& b, std::size_t length,
                       const Sums<std::int64_t>& out) {
  for_each_tile(a.count, b.count, [&](auto m, auto n, std::size_t i, std::size_t j) EIGENPOSE_INLINE_LAMBDA {
    add_word_tile<m, n>(a.data + i * a.stride, a.stride, b.data + j * b.stride, b.stride, length,
                        Sums<std::int64_t>{out.data + i * out.stride + j, out.stride});
  });
}

using Doubles = hn::CappedTag<double, 4>;
using DoubleVector = hn::Vec<Doubles>;
constexpr std::size_t double_lanes = hn::MaxLanes(Doubles());
/// Vectors that hold the four running sums.
constexpr std::size_t double_parts = 4 / double_lanes;

/// (s₀+s₂)+(s₁+s₃): the order that every target keeps.
HWY_INLINE double total_of(const DoubleVector (&sums)[double_parts]) {
  HWY_ALIGN double s[4];
  unroll<double_parts>([&](auto p)
                           EIGENPOSE_INLINE_LAMBDA { hn::Store(sums[p], Doubles(), s + p * double_lanes); });
  return (s[0] + s[2]) + (s[1] + s[3]);
}

template <std::size_t m, std::size_t n>
HWY_INLINE void add_double_tile(const double* a, std::size_t lda, const double* b, std::size_t ldb,
                                std::size_t length, const Sums<double>& out) {
  const Doubles d;
  DoubleVector sums[m][n][double_parts];
  unroll<m * n * double_parts>([&](auto s) EIGENPOSE_INLINE_LAMBDA {
    sums[s / (n * double_parts)][s / double_parts % n][s % double_parts] = hn::Zero(d);
  });
  const std::size_t whole = length - length % 4;
  for (std::size_t k = 0; k < whole; k += 4) {
    unroll<double_parts>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
      const std::size_t at = k + p * double_lanes;
      DoubleVector x[m];
      unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA { x[i] = hn::LoadU(d, a + i * lda + at); });
      unroll<n>([&](auto j) EIGENPOSE_INLINE_LAMBDA {
        const DoubleVector y = hn::LoadU(d, b + j * ldb + at);
        unroll<m>([&](auto i)
                      EIGENPOSE_INLINE_LAMBDA { sums[i][j][p] = hn::MulAdd(x[i], y, sums[i][j][p]); });
      });
    });
  }
  unroll<m>([&](auto i) EIGENPOSE_INLINE_LAMBDA {
    unroll<n>([&](auto j) EIGENPOSE_INLINE_LAMBDA {
      double sum = total_of(sums[i][j]);
      for (std::size_t k = whole; k < length; ++k) sum += a[i * lda + k] * b[j * ldb + k];
      out.data[i * out.stride + j] += sum;
    });
  });
}

void add_double_products(const Rows<double>& a, const Rows<double>& b, std::size_t length,
                         const Sums<double>& out) {
  for_each_tile(a.count, b.count, [&](auto m, auto n, std::size_t i, std::size_t j) EIGENPOSE_INLINE_LAMBDA {
    add_double_tile<m, n>(a.data + i * a.stride, a.stride, b.data + j * b.stride, b.stride, length,
                          Sums<double>{out.data + i * out.stride + j, out.stride});
  });
}

/// `m` rows of weights times a column of `n` vectors of the tag D.
template <std::size_t m, std::size_t n, class D>
HWY_INLINE void add_combined_tile(D d, const Rows<double>& weights, const Rows<double>& rows,
                                  const Sums<double>& out) {
  using V = hn::Vec<D>;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  V sums[m][n];
  unroll<m>([&](auto r) EIGENPOSE_INLINE_LAMBDA {
    unroll<n>([&](auto p) EIGENPOSE_INLINE_LAMBDA { sums[r][p] = hn::Zero(d); });
  });
  for (std::size_t j = 0; j < rows.count; ++j) {
    V x[n];
    unroll<n>([&](auto p)
                  EIGENPOSE_INLINE_LAMBDA { x[p] = hn::LoadU(d, rows.data + j * rows.stride + p * lanes); });
    unroll<m>([&](auto r) EIGENPOSE_INLINE_LAMBDA {
      const V weight = hn::Set(d, weights.data[r * weights.stride + j]);
      unroll<n>([&](auto p) EIGENPOSE_INLINE_LAMBDA { sums[r][p] = hn::MulAdd(weight, x[p], sums[r][p]); });
    });
  }
  unroll<m>([&](auto r) EIGENPOSE_INLINE_LAMBDA {
    unroll<n>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
      double* to = out.data + r * out.stride + p * lanes;
      hn::StoreU(hn::Add(hn::LoadU(d, to), sums[r][p]), d, to);
    });
  });
}

/// All rows of weights times a column of `n` vectors.
template <std::size_t n, class D>
HWY_INLINE void add_combined_column(D d, const Rows<double>& weights, const Rows<double>& rows,
                                    const Sums<double>& out) {
  const auto below = [&](std::size_t r) {
    return Rows<double>{weights.data + r * weights.stride, weights.stride, 0};
  };
  std::size_t r = 0;
  for (; r + 4 <= weights.count; r += 4)
    add_combined_tile<4, n>(d, below(r), rows, Sums<double>{out.data + r * out.stride, out.stride});
  for (; r < weights.count; ++r)
    add_combined_tile<1, n>(d, below(r), rows, Sums<double>{out.data + r * out.stride, out.stride});
}

void add_combinations(const Rows<double>& weights, const Rows<double>& rows, std::size_t width,
                      const Sums<double>& out) {
  const hn::ScalableTag<double> d;
  const hn::CappedTag<double, 1> one;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const auto from = [&](std::size_t p) { return Rows<double>{rows.data + p, rows.stride, rows.count}; };
  const auto to = [&](std::size_t p) { return Sums<double>{out.data + p, out.stride}; };
  std::size_t p = 0;
  for (; p + 2 * lanes <= width; p += 2 * lanes) add_combined_column<2>(d, weights, from(p), to(p));
  for (; p < width; ++p) add_combined_column<1>(one, weights, from(p), to(p));
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(widen_bytes);
HWY_EXPORT(add_word_products);
HWY_EXPORT(add_double_products);
HWY_EXPORT(add_combinations);

void widen_bytes(const std::uint8_t* bytes, std::size_t n, std::int16_t* words) {
  HWY_DYNAMIC_DISPATCH(widen_bytes)(bytes, n, words);
}

void add_inner_products(const Rows<std::int16_t>& a, const Rows<std::int16_t>& b, std::size_t length,
                        const Sums<std::int64_t>& out) {
  HWY_DYNAMIC_DISPATCH(add_word_products)(a, b, length, out);
}

void add_inner_products(const Rows<double>& a, const Rows<double>& b, std::size_t length,
                        const Sums<double>& out) {
  HWY_DYNAMIC_DISPATCH(add_double_products)(a, b, length, out);
}

void add_combinations(const Rows<double>& weights, const Rows<double>& rows, std::size_t width,
                      const Sums<double>& out) {
  HWY_DYNAMIC_DISPATCH(add_combinations)(weights, rows, width, out);
}

}  // namespace eigenpose
#endif
