#pragma once

/// Turns a row of pixels into a row of foreground bits. Exact. Thread-safe.

#include <cstdint>

namespace eigenpose {

/// Bit x of `bits` (64 a word, lowest first, (width + 63) / 64 words) is 1 when a band of pixel x is above
/// `threshold`. Bits beyond `width` are 0. `row` holds width × bands bytes, unaligned; bands is 1 or 3.
void threshold_row(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                   std::uint64_t* bits);

}  // namespace eigenpose
