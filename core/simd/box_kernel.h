#pragma once

/// Distances from a point to many axis-aligned boxes at once: the inner loop of the tree.

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

/// What the kernel says of each box.
struct alignas(64) BoxDistances {
  /// Squared distance from the point to the box, from below up to float rounding; where it exceeds the bound
  /// it may stop growing early.
  float squared[box_lanes];
  /// Squared distance to the box plus a little of that to its centre: the order to look at them in. Only if
  /// asked for.
  float order[box_lanes];
};

/// @param slices one per dimension. @param point as many floats. @param ordered whether `order` is wanted.
/// @returns a bit per box: set where the squared distance is at most `bound`. If none is, the loop ends
/// early.
using BoxKernel = std::uint32_t (*)(const BoxSlice* slices, const float* point, std::size_t dimensions,
                                    float bound, bool ordered, BoxDistances& distances);

}  // namespace eigenpose
