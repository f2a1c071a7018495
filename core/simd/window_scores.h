#pragma once

/// Scores of learned windows against those of a picture: most of the time of partial matching. Exact, and the
/// same on every target. Thread-safe.

#include <cstddef>
#include <cstdint>
#include <span>

namespace eigenpose {

/// A query window that is compared with the learned windows of one place.
struct PlacedQuery {
  const std::uint8_t* values;  ///< 32 components 0…127
  std::int32_t penalty;        ///< for the offset between the two places
  std::uint32_t index;         ///< of its row of scores
};

/// For each query and each of groups × 8 views of one place: score ← max(score, Σ_k query[k]·value[k] − bias
/// − penalty), over 32 components. No pointer needs alignment. Queries may share an index.
/// @param values groups × 256 bytes: [8][8 views][4 components]; @param biases groups × 8;
/// @param scores rows of groups × 8, one for each query's index.
void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores);

}  // namespace eigenpose
