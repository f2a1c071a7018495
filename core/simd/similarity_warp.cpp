#include "core/simd/similarity_warp.h"

#include <algorithm>
#include <cstdint>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/similarity_warp.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// A texel is one vector, and a step of the result as many pixels as a texel has floats; on the portable
/// target both are gone through float by float.
using F = hn::CappedTag<float, 4>;
using I = hn::Rebind<std::int32_t, F>;
using V = hn::Vec<F>;
constexpr std::size_t lanes = hn::MaxLanes(F());
constexpr std::ptrdiff_t texel_floats = 4;

struct Samples {
  V value;
  V by_x;
  V by_y;
};

/// Floats [first, first + lanes) of the texel between four, `across` and `down` from the first.
HWY_INLINE V between(const float* texel, std::ptrdiff_t row_floats, V across, V down) {
  const F d;
  const V left = hn::LoadU(d, texel);
  const V below = hn::LoadU(d, texel + row_floats);
  const V top = hn::Add(left, hn::Mul(across, hn::Sub(hn::LoadU(d, texel + texel_floats), left)));
  const V bottom =
      hn::Add(below, hn::Mul(across, hn::Sub(hn::LoadU(d, texel + row_floats + texel_floats), below)));
  return hn::Add(top, hn::Mul(down, hn::Sub(bottom, top)));
}

/// Samples at `lanes` places.
HWY_INLINE Samples sample(const GradientPicture& picture, V x, V y) {
  const F d;
  const I d_index;
  const V last = hn::Set(d, static_cast<float>(picture.side - 1));
  x = hn::Min(hn::Max(x, hn::Zero(d)), last);
  y = hn::Min(hn::Max(y, hn::Zero(d)), last);
  // Bounded as integers too: a position that is not a number ends inside as well.
  const auto before_last = hn::Set(d_index, picture.side - 2);
  const auto column = hn::Min(hn::Max(hn::ConvertTo(d_index, x), hn::Zero(d_index)), before_last);
  const auto row = hn::Min(hn::Max(hn::ConvertTo(d_index, y), hn::Zero(d_index)), before_last);
  HWY_ALIGN float across[lanes];
  HWY_ALIGN float down[lanes];
  HWY_ALIGN std::int32_t texel[lanes];
  hn::Store(hn::Sub(x, hn::ConvertTo(d, column)), d, across);
  hn::Store(hn::Sub(y, hn::ConvertTo(d, row)), d, down);
  hn::Store(hn::Add(hn::Mul(row, hn::Set(d_index, picture.side)), column), d_index, texel);
  const std::ptrdiff_t row_floats = texel_floats * picture.side;
#if HWY_TARGET == HWY_SCALAR
  const float* from = picture.texels + texel_floats * texel[0];
  const V fx = hn::Set(d, across[0]);
  const V fy = hn::Set(d, down[0]);
  return {between(from, row_floats, fx, fy), between(from + 1, row_floats, fx, fy),
          between(from + 2, row_floats, fx, fy)};
#else
  static_assert(lanes == static_cast<std::size_t>(texel_floats));
  V s[lanes];
  unroll<lanes>([&](auto k) EIGENPOSE_INLINE_LAMBDA {
    s[k] = between(picture.texels + texel_floats * texel[k], row_floats, hn::Set(d, across[k]),
                   hn::Set(d, down[k]));
  });
  // Transposed: from four floats of each place to one float of four places.
  const V first_two = hn::InterleaveLower(d, s[0], s[1]);
  const V last_two = hn::InterleaveLower(d, s[2], s[3]);
  return {hn::ConcatLowerLower(d, last_two, first_two), hn::ConcatUpperUpper(d, last_two, first_two),
          hn::ConcatLowerLower(d, hn::InterleaveUpper(d, s[2], s[3]), hn::InterleaveUpper(d, s[0], s[1]))};
#endif
}

/// Writes the first `count` lanes.
HWY_INLINE void put(V v, std::size_t count, float* to) {
  const F d;
  if (count == lanes) {
    hn::StoreU(v, d, to);
    return;
  }
  HWY_ALIGN float all[lanes];
  hn::Store(v, d, all);
  std::copy_n(all, count, to);
}

template <bool with_derivatives>
HWY_INLINE void sample_all(const GradientPicture& picture, const SimilaritySampling& sampling, float* values,
                           const SimilarityDerivatives& derivatives) {
  const F d;
  const auto side = static_cast<std::size_t>(sampling.side);
  const V cosine = hn::Set(d, sampling.cosine);
  const V sine = hn::Set(d, sampling.sine);
  const auto from_middle = [&](V index) EIGENPOSE_INLINE_LAMBDA {
    return hn::Sub(hn::Mul(hn::Add(index, hn::Set(d, 0.5F)), hn::Set(d, sampling.step)),
                   hn::Set(d, sampling.middle));
  };
  for (std::size_t row = 0; row < side; ++row) {
    const V v = from_middle(hn::Set(d, static_cast<float>(row)));
    const V sine_v = hn::Mul(sine, v);
    const V cosine_v = hn::Mul(cosine, v);
    for (std::size_t column = 0; column < side; column += lanes) {
      const V u = from_middle(hn::Iota(d, static_cast<float>(column)));
      const V dx = hn::Sub(hn::Mul(cosine, u), sine_v);
      const V dy = hn::Add(hn::Mul(sine, u), cosine_v);
      const Samples s =
          sample(picture, hn::Add(hn::Set(d, sampling.x), dx), hn::Add(hn::Set(d, sampling.y), dy));
      const std::size_t count = std::min(lanes, side - column);
      const std::size_t at = row * side + column;
      put(s.value, count, values + at);
      if constexpr (with_derivatives) {
        put(s.by_x, count, derivatives.by_x + at);
        put(s.by_y, count, derivatives.by_y + at);
        put(hn::Add(hn::Mul(s.by_x, dx), hn::Mul(s.by_y, dy)), count, derivatives.by_scale + at);
        put(hn::Sub(hn::Mul(s.by_y, dx), hn::Mul(s.by_x, dy)), count, derivatives.by_rotation + at);
      }
    }
  }
}

void sample_values(const GradientPicture& picture, const SimilaritySampling& sampling, float* values) {
  sample_all<false>(picture, sampling, values, {});
}

void sample_with_derivatives(const GradientPicture& picture, const SimilaritySampling& sampling,
                             float* values, const SimilarityDerivatives& derivatives) {
  sample_all<true>(picture, sampling, values, derivatives);
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(sample_values);
HWY_EXPORT(sample_with_derivatives);

void sample_similarity(const GradientPicture& picture, const SimilaritySampling& sampling, float* values) {
  HWY_DYNAMIC_DISPATCH(sample_values)(picture, sampling, values);
}

void sample_similarity(const GradientPicture& picture, const SimilaritySampling& sampling, float* values,
                       const SimilarityDerivatives& derivatives) {
  HWY_DYNAMIC_DISPATCH(sample_with_derivatives)(picture, sampling, values, derivatives);
}

}  // namespace eigenpose
#endif
