#include "core/simd/threshold.h"

#include <cstddef>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/threshold.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t word_pixels = 64;
using D = hn::CappedTag<std::uint8_t, word_pixels>;
constexpr std::size_t lanes = hn::MaxLanes(D());

/// The word of `count` ≤ 64 pixels.
template <int bands>
HWY_INLINE std::uint64_t plain_word(const std::uint8_t* pixels, std::size_t count, std::uint8_t threshold) {
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < count; ++i) {
    bool above = false;
    for (std::size_t b = 0; b < bands; ++b) above |= pixels[i * bands + b] > threshold;
    word |= static_cast<std::uint64_t>(above) << i;
  }
  return word;
}

/// The word of 64 pixels.
template <int bands>
HWY_INLINE std::uint64_t whole_word(const std::uint8_t* pixels, std::uint8_t threshold) {
  if constexpr (lanes < 8) {
    return plain_word<bands>(pixels, word_pixels, threshold);
  } else {
    const D d;
    std::uint64_t word = 0;
    unroll<word_pixels / lanes>([&](auto part) EIGENPOSE_INLINE_LAMBDA {
      const std::uint8_t* from = pixels + part * lanes * bands;
      hn::Vec<D> brightest;
      if constexpr (bands == 1) {
        brightest = hn::LoadU(d, from);
      } else {
        hn::Vec<D> second;
        hn::Vec<D> third;
        hn::LoadInterleaved3(d, from, brightest, second, third);
        brightest = hn::Max(brightest, hn::Max(second, third));
      }
      std::uint8_t bytes[8] = {};
      hn::StoreMaskBits(d, hn::Gt(brightest, hn::Set(d, threshold)), bytes);
      unroll<lanes / 8>([&](auto byte) EIGENPOSE_INLINE_LAMBDA {
        word |= static_cast<std::uint64_t>(bytes[byte]) << (part * lanes + 8 * byte);
      });
    });
    return word;
  }
}

template <int bands>
HWY_INLINE void threshold_bands(const std::uint8_t* row, std::size_t width, std::uint8_t threshold,
                                std::uint64_t* bits) {
  std::size_t x = 0;
  for (; x + word_pixels <= width; x += word_pixels)
    bits[x / word_pixels] = whole_word<bands>(row + x * bands, threshold);
  if (x < width) bits[x / word_pixels] = plain_word<bands>(row + x * bands, width - x, threshold);
}

void threshold_row(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                   std::uint64_t* bits) {
  const auto pixels = static_cast<std::size_t>(width);
  bands == 1 ? threshold_bands<1>(row, pixels, threshold, bits)
             : threshold_bands<3>(row, pixels, threshold, bits);
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(threshold_row);

void threshold_row(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                   std::uint64_t* bits) {
  HWY_DYNAMIC_DISPATCH(threshold_row)(row, width, bands, threshold, bits);
}

}  // namespace eigenpose
#endif
