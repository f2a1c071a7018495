#pragma once

/// Luma of camera formats. Exact, and the same on every target. No pointer needs alignment; input and output
/// do not overlap. Thread-safe.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// out[i] = ⌊(⌊max(0, y − 16)·596 / 256⌋ + 1) / 2⌋, at most 255, with y = source[i]: limited range (16 … 235,
/// ITU-R BT.601) spread to 0 … 255. 596/512 is 255/219 to within a rounding for every byte.
void spread_limited(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels);

/// out[i] = source[2i]: the luma of Y U Y V. `source` holds 2·pixels bytes.
void even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels);

/// Both at once: limited-range luma of Y U Y V, spread.
void spread_even_bytes(const std::uint8_t* source, std::uint8_t* out, std::size_t pixels);

}  // namespace eigenpose
