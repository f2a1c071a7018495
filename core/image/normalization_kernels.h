#pragma once

/// Kernels of the normalisation. The instructions are chosen at run time; all give the same values up to
/// rounding.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// out[i] = max(0, bytes[i] − level[i mod period]), i < count. `period` is 1 or 3.
void subtract_level(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* level, int period,
                    float* out);

/// out[i] += weight · in[i], i < count.
void add_weighted(const float* in, float weight, std::size_t count, float* out);

/// The largest of `count` numbers ≥ 0; 0 of none.
float largest_of(const float* in, std::size_t count);

/// bytes[i] = gain · in[i] rounded, i < count. The products are in 0…255.
void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes);

}  // namespace eigenpose
