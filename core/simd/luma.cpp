#include "core/simd/luma.h"

#include <algorithm>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/luma.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::ScalableTag<std::uint16_t>;
using Bytes = hn::Rebind<std::uint8_t, Words>;
constexpr std::size_t lanes = hn::MaxLanes(Words());
constexpr std::uint16_t black = 16;
constexpr std::uint16_t gain = 596;  // of 512

std::uint8_t spread(std::uint8_t limited) {
  const int above_black = std::max(limited - black, 0);
  return static_cast<std::uint8_t>(std::min((above_black * gain / 256 + 1) / 2, 255));
}

/// The same of words that are 0 … 255 each.
HWY_INLINE hn::Vec<Bytes> spread(hn::Vec<Words> limited) {
  const Words d;
  const auto above_black = hn::SaturatedSub(limited, hn::Set(d, black));
  const auto twice = hn::MulHigh(hn::ShiftLeft<8>(above_black), hn::Set(d, gain));
  const auto rounded = hn::ShiftRight<1>(hn::Add(twice, hn::Set(d, std::uint16_t{1})));
  return hn::DemoteTo(Bytes(), hn::BitCast(hn::RebindToSigned<Words>(), rounded));
}

/// The lower bytes of `lanes` words in memory.
HWY_INLINE hn::Vec<Words> lower_bytes(const std::uint8_t* source) {
  hn::Vec<Bytes> even;
  hn::Vec<Bytes> odd;
  hn::LoadInterleaved2(Bytes(), source, even, odd);
  return hn::PromoteTo(Words(), even);
}

void spread_limited(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  std::size_t i = 0;
  for (; i + lanes <= pixels; i += lanes)
    hn::StoreU(spread(hn::PromoteTo(Words(), hn::LoadU(Bytes(), source + i))), Bytes(), out + i);
  for (; i < pixels; ++i) out[i] = spread(source[i]);
}

void even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  const hn::ScalableTag<std::uint8_t> d;
  constexpr std::size_t step = hn::MaxLanes(d);
  std::size_t i = 0;
  for (; i + step <= pixels; i += step) {
    hn::Vec<decltype(d)> even;
    hn::Vec<decltype(d)> odd;
    hn::LoadInterleaved2(d, source + 2 * i, even, odd);
    hn::StoreU(even, d, out + i);
  }
  for (; i < pixels; ++i) out[i] = source[2 * i];
}

void spread_even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  std::size_t i = 0;
  for (; i + lanes <= pixels; i += lanes) hn::StoreU(spread(lower_bytes(source + 2 * i)), Bytes(), out + i);
  for (; i < pixels; ++i) out[i] = spread(source[2 * i]);
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(spread_limited);
HWY_EXPORT(even_bytes);
HWY_EXPORT(spread_even_bytes);

void spread_limited(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  HWY_DYNAMIC_DISPATCH(spread_limited)(source, out, pixels);
}

void even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  HWY_DYNAMIC_DISPATCH(even_bytes)(source, out, pixels);
}

void spread_even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels) {
  HWY_DYNAMIC_DISPATCH(spread_even_bytes)(source, out, pixels);
}

}  // namespace eigenpose
#endif
