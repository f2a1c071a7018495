#pragma once

/// Distances from a point to many axis-aligned boxes at once: the inner loop of the search tree.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// Boxes per node of the tree.
inline constexpr std::size_t box_lanes = 16;

/// One dimension of all boxes of a node.
struct alignas(64) BoxSlice {
  float low[box_lanes];
  float high[box_lanes];
};

/// Result of the kernels, for each box.
struct alignas(64) BoxDistances {
  /// Squared distance from the point to the box, a lower bound up to float rounding; once no box is within
  /// the bound, later dimensions are not added.
  float squared[box_lanes];
  /// Squared distance to the box plus a little of that to its centre: the order to visit them in.
  float order[box_lanes];
};

/// Distances to the 16 boxes of a node; `distances.order` is not written. Sums over dimensions in order, each
/// operation rounded by itself: every target gives the same bits. Thread-safe.
/// @param slices one per dimension, aligned as their type says. @param point as many floats, unaligned.
/// @returns a bit per box: set where the squared distance is at most `bound`.
std::uint32_t box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                            BoxDistances& distances);

/// The same, with `distances.order`.
std::uint32_t ordered_box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions,
                                    float bound, BoxDistances& distances);

}  // namespace eigenpose
