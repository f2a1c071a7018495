#include "drivers/v4l2/luma.h"

#include <cstring>

#include "core/simd/luma.h"

namespace eigenpose {

void luma_of_yuyv(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range) {
  if (range == LumaRange::limited) {
    spread_even_bytes(source, luma, pixels);
  } else {
    even_bytes(source, luma, pixels);
  }
}

void copy_luma(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range) {
  if (range == LumaRange::limited) {
    spread_limited(source, luma, pixels);
  } else {
    std::memcpy(luma, source, pixels);
  }
}

}  // namespace eigenpose
