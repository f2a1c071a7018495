#pragma once

/// The inner loop of partial matching, in integers: the same answer on every machine.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// For each of groups × 8 views: score ← max(score, Σ_k query[k]·value[k] − bias − penalty), over 32
/// dimensions.
/// @param values groups × 256 bytes: [8][8 views][4 dimensions]; @param biases groups × 8;
/// @param query 32 numbers 0…127, so that no partial sum of 16 bits overflows.
void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  const std::uint8_t* query, std::int32_t penalty, std::int32_t* scores);

/// The same without special instructions: the oracle of the tests.
void raise_scores_portable(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                           const std::uint8_t* query, std::int32_t penalty, std::int32_t* scores);

}  // namespace eigenpose
