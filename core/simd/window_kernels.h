#pragma once

/// The inner loop of partial matching, in integers: the same answer on every machine.

#include <cstddef>
#include <cstdint>
#include <span>

namespace eigenpose {

/// A query window that is compared with the learned windows of one place.
struct PlacedQuery {
  const std::uint8_t* values;  ///< 32 numbers 0…127, so that no partial sum of 16 bits overflows
  std::int32_t penalty;        ///< for the offset between the two places
  std::uint32_t index;         ///< of its row of scores
};

/// For each query and each of groups × 8 views of one place: score ← max(score, Σ_k query[k]·value[k] − bias
/// − penalty), over 32 dimensions.
/// @param values groups × 256 bytes: [8][8 views][4 dimensions]; @param biases groups × 8;
/// @param scores rows of groups × 8, one for each query's index.
void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores);

/// The same without special instructions: the oracle of the tests.
void raise_scores_portable(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                           std::span<const PlacedQuery> queries, std::int32_t* scores);

}  // namespace eigenpose
