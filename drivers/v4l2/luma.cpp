#include "drivers/v4l2/luma.h"

#include <algorithm>
#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace eigenpose {
namespace {

/// 255/219 as 596/512: right to within a rounding for every byte.
std::uint8_t spread(std::uint8_t limited) {
  const int above_black = std::max(limited - 16, 0);
  return static_cast<std::uint8_t>(std::min((above_black * 596 / 256 + 1) / 2, 255));
}

#ifdef __SSE2__
/// The same for eight words, each a byte 0 … 255.
__m128i spread(__m128i words) {
  const __m128i above_black = _mm_subs_epu16(words, _mm_set1_epi16(16));
  const __m128i twice = _mm_mulhi_epu16(_mm_slli_epi16(above_black, 8), _mm_set1_epi16(596));
  return _mm_srli_epi16(_mm_add_epi16(twice, _mm_set1_epi16(1)), 1);
}

__m128i load(const std::uint8_t* from) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}
void store(std::uint8_t* to, __m128i value) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), value);
}
#endif

}  // namespace

void luma_of_yuyv(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range) {
  std::size_t done = 0;
#ifdef __SSE2__
  const __m128i low_bytes = _mm_set1_epi16(0x00ff);
  for (; done + 16 <= pixels; done += 16) {
    __m128i left = _mm_and_si128(load(source + 2 * done), low_bytes);
    __m128i right = _mm_and_si128(load(source + 2 * done + 16), low_bytes);
    if (range == LumaRange::limited) {
      left = spread(left);
      right = spread(right);
    }
    store(luma + done, _mm_packus_epi16(left, right));  // packing saturates at 255
  }
#endif
  for (; done < pixels; ++done) {
    luma[done] = range == LumaRange::limited ? spread(source[2 * done]) : source[2 * done];
  }
}

void copy_luma(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range) {
  if (range == LumaRange::full) {
    std::memcpy(luma, source, pixels);
    return;
  }
  std::size_t done = 0;
#ifdef __SSE2__
  const __m128i zero = _mm_setzero_si128();
  for (; done + 16 <= pixels; done += 16) {
    const __m128i bytes = load(source + done);
    store(luma + done,
          _mm_packus_epi16(spread(_mm_unpacklo_epi8(bytes, zero)), spread(_mm_unpackhi_epi8(bytes, zero))));
  }
#endif
  for (; done < pixels; ++done) luma[done] = spread(source[done]);
}

}  // namespace eigenpose
