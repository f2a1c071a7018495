#pragma once

/// Kernels of the normalisation. The instructions are chosen at run time; all give the same values up to
/// rounding.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// Levels stand this often one after the other: whole pixels of one or three bands, and whole vectors.
inline constexpr std::size_t level_block = 96;

/// out[i] += weight · max(0, bytes[i] − levels[i mod level_block]), i < count.
void add_above_levels(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* levels, float weight,
                      float* out);

/// Sum of the squares of `count` numbers.
float energy_of(const float* in, std::size_t count);

/// The largest of `count` numbers ≥ 0; 0 of none.
float largest_of(const float* in, std::size_t count);

/// bytes[i] = gain · in[i] rounded, i < count. The products are in 0…255.
void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes);

}  // namespace eigenpose
