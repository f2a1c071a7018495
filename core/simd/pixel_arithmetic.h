#pragma once

/// Arithmetic over all pixels of a picture, for its normalisation. No pointer needs alignment; input and
/// output do not overlap. Thread-safe; the same machine gives the same bits each time.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// Length of the pattern of levels: whole pixels of one or three bands, and whole vectors.
inline constexpr std::size_t level_block = 96;

/// out[i] += weight · max(0, bytes[i] − levels[i mod level_block]), i < count. `levels` holds level_block
/// bytes. The difference is exact; the product and the sum are rounded once or twice, depending on the
/// target: an error of 2⁻²³ of the larger of the two.
void add_above_levels(const std::uint8_t* bytes, std::size_t count, const std::uint8_t* levels, float weight,
                      float* out);

/// Sum of the squares of `count` floats; 0 of none. Error below count·2⁻²⁴ of the sum.
float sum_of_squares(const float* in, std::size_t count);

/// The largest of `count` floats ≥ 0; 0 of none. Exact.
float largest_of(const float* in, std::size_t count);

/// bytes[i] = ⌊gain·in[i] + ½⌋ of floats in[i] ≥ 0, at most 255; the product and the sum are rounded to
/// float. Every target gives the same bytes. @pre gain·in[i] < 2³¹.
void round_scaled(const float* in, float gain, std::size_t count, std::uint8_t* bytes);

/// out = the pixels of `in` (blue, green, red) in an orthonormal basis: (b + g + r)/√3, weight·(r − g)/√2,
/// weight·(2b − r − g)/√6. `count` pixels. Error below 2⁻²²·weight·(|b| + |g| + |r|) each.
void to_opponent_axes(const float* in, std::size_t count, float weight, float* out);

}  // namespace eigenpose
