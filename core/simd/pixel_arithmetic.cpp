#include "core/simd/pixel_arithmetic.h"

#include <algorithm>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/pixel_arithmetic.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using I = hn::Rebind<std::int32_t, F>;
using B = hn::Rebind<std::uint8_t, F>;  // as many bytes as floats
using V = hn::Vec<F>;
constexpr std::size_t lanes = hn::MaxLanes(F());

void add_above_levels(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* levels, float weight,
                      float* out) {
  static_assert(level_block % lanes == 0);
  const F d;
  const V factor = hn::Set(d, weight);
  const auto add = [&](std::size_t i, std::size_t level) EIGENPOSE_INLINE_LAMBDA {
    const auto above = hn::SaturatedSub(hn::LoadU(B(), bytes + i), hn::LoadU(B(), levels + level));
    const V floats = hn::ConvertTo(d, hn::PromoteTo(I(), above));
    hn::StoreU(hn::MulAdd(factor, floats, hn::LoadU(d, out + i)), d, out + i);
  };
  std::size_t i = 0;
  for (; i + level_block <= count; i += level_block)
    for (std::size_t level = 0; level < level_block; level += lanes) add(i + level, level);
  std::size_t level = 0;
  for (; i + lanes <= count; i += lanes, level += lanes) add(i, level);
  for (; i < count; ++i, ++level)
    out[i] += weight *
              static_cast<float>(std::max(0, static_cast<int>(bytes[i]) - static_cast<int>(levels[level])));
}

float sum_of_squares(const float* in, std::size_t count) {
  // Few enough floats in each running sum that their total in double keeps the error small.
  constexpr std::size_t running = std::max<std::size_t>(4, 32 / lanes);
  const F d;
  V sums[running];
  unroll<running>([&](auto s) EIGENPOSE_INLINE_LAMBDA { sums[s] = hn::Zero(d); });
  std::size_t i = 0;
  for (; i + running * lanes <= count; i += running * lanes) {
    unroll<running>([&](auto s) EIGENPOSE_INLINE_LAMBDA {
      const V values = hn::LoadU(d, in + i + s * lanes);
      sums[s] = hn::MulAdd(values, values, sums[s]);
    });
  }
  HWY_ALIGN float parts[running * lanes];
  unroll<running>([&](auto s) EIGENPOSE_INLINE_LAMBDA { hn::Store(sums[s], d, parts + s * lanes); });
  double total = 0.0;
  for (const float part : parts) total += static_cast<double>(part);
  for (; i < count; ++i) total += static_cast<double>(in[i]) * static_cast<double>(in[i]);
  return static_cast<float>(total);
}

float largest_of(const float* in, std::size_t count) {
  const F d;
  V most = hn::Zero(d);
  V other = hn::Zero(d);
  std::size_t i = 0;
  for (; i + 2 * lanes <= count; i += 2 * lanes) {
    most = hn::Max(most, hn::LoadU(d, in + i));
    other = hn::Max(other, hn::LoadU(d, in + i + lanes));
  }
  float result = hn::GetLane(hn::MaxOfLanes(d, hn::Max(most, other)));
  for (; i < count; ++i) result = std::max(result, in[i]);
  return result;
}

void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes) {
  constexpr float half = 0.5F;
  const F d;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const V rounded = hn::Add(hn::Mul(hn::LoadU(d, in + i), hn::Set(d, gain)), hn::Set(d, half));
    const auto whole = hn::ConvertTo(I(), hn::Min(rounded, hn::Set(d, 255.0F)));
    hn::StoreU(hn::U8FromU32(hn::BitCast(hn::RebindToUnsigned<I>(), whole)), B(), bytes + i);
  }
  for (; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(std::min(255.0F, in[i] * gain + half));
}

void to_opponent_axes(const float* in, std::size_t count, float weight, float* out) {
  constexpr float root_third = 0.57735027F;
  const float root_half = weight * 0.70710678F;
  const float root_sixth = weight * 0.40824829F;
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR
  const F d;
  for (; i + lanes <= count; i += lanes) {
    V blue;
    V green;
    V red;
    hn::LoadInterleaved3(d, in + 3 * i, blue, green, red);
    const V sum = hn::Add(green, red);
    hn::StoreInterleaved3(hn::Mul(hn::Set(d, root_third), hn::Add(blue, sum)),
                          hn::Mul(hn::Set(d, root_half), hn::Sub(red, green)),
                          hn::Mul(hn::Set(d, root_sixth), hn::Sub(hn::Add(blue, blue), sum)), d, out + 3 * i);
  }
#endif
  for (; i < count; ++i) {
    const float blue = in[3 * i];
    const float green = in[3 * i + 1];
    const float red = in[3 * i + 2];
    out[3 * i] = root_third * (blue + (green + red));
    out[3 * i + 1] = root_half * (red - green);
    out[3 * i + 2] = root_sixth * ((blue + blue) - (green + red));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(add_above_levels);
HWY_EXPORT(sum_of_squares);
HWY_EXPORT(largest_of);
HWY_EXPORT(round_scaled);
HWY_EXPORT(to_opponent_axes);

void add_above_levels(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* levels, float weight,
                      float* out) {
  HWY_DYNAMIC_DISPATCH(add_above_levels)(bytes, count, levels, weight, out);
}

float sum_of_squares(const float* in, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(sum_of_squares)(in, count);
}

float largest_of(const float* in, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(largest_of)(in, count);
}

void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes) {
  HWY_DYNAMIC_DISPATCH(round_scaled)(in, gain, count, bytes);
}

void to_opponent_axes(const float* in, std::size_t count, float weight, float* out) {
  HWY_DYNAMIC_DISPATCH(to_opponent_axes)(in, count, weight, out);
}

}  // namespace eigenpose
#endif
