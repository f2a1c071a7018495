#pragma once

/// Kernels that turn a row of pixels into a row of foreground bits. The instructions are chosen at run time.

#include <cstdint>

namespace eigenpose {

/// Bit x of `bits` (64 a word, lowest first, (width + 63) / 64 words) is 1 when a band of pixel x is above
/// `threshold`. Bits beyond `width` are 0. `row` holds width × bands bytes; bands is 1 or 3.
void threshold_row(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                   std::uint64_t* bits);

/// The same without vector instructions: what the fast kernels are tested against.
void threshold_row_plain(const std::uint8_t* row, int width, int bands, std::uint8_t threshold,
                         std::uint64_t* bits);

}  // namespace eigenpose
