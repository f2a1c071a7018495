#pragma once

/// The one body of all box kernels, compiled once per instruction set. Included by their .cpp files only.

#include "core/simd/box_kernel.h"

namespace eigenpose {
namespace {

/// Weight of the distance to the centre in the order. Near the root several boxes contain the point; this
/// takes the one it lies deepest in.
constexpr float centre_weight = 0.02F;
/// Dimensions between two looks at whether any box is still within the bound.
constexpr std::size_t look_every = 4;

/// `Isa` says what a register is: its vector type, `all` lanes equal, the `larger` of two and the mask of
/// lanes `within` a bound.
template <typename Isa>
struct BoxBody {
  using Vector = typename Isa::Vector;
  static constexpr std::size_t lanes = sizeof(Vector) / sizeof(float);
  static constexpr std::size_t parts = box_lanes / lanes;

  template <bool Ordered>
  [[gnu::always_inline]] static inline std::uint32_t run(const BoxSlice* slices, const float* point,
                                                         std::size_t dimensions, float bound,
                                                         BoxDistances& distances) {
    Vector squared[parts] = {};
    Vector centre[parts] = {};
    const Vector limit = Isa::all(bound);
    std::uint32_t mask = 0;
    for (std::size_t d = 0; d < dimensions;) {
      const std::size_t to = dimensions - d > look_every ? d + look_every : dimensions;
      for (; d < to; ++d) {
        const Vector q = Isa::all(point[d]);
        for (std::size_t p = 0; p < parts; ++p) {
          const Vector below = reinterpret_cast<const Vector*>(slices[d].low)[p] - q;
          const Vector above = q - reinterpret_cast<const Vector*>(slices[d].high)[p];
          const Vector outside = Isa::larger(Isa::larger(below, above), Vector{});
          squared[p] += outside * outside;
          if constexpr (Ordered) centre[p] += (below - above) * (below - above);
        }
      }
      mask = 0;
      for (std::size_t p = 0; p < parts; ++p) mask |= Isa::within(squared[p], limit) << (p * lanes);
      if (mask == 0) break;
    }
    for (std::size_t p = 0; p < parts; ++p) {
      reinterpret_cast<Vector*>(distances.squared)[p] = squared[p];
      if constexpr (Ordered)
        reinterpret_cast<Vector*>(distances.order)[p] = squared[p] + 0.25F * centre_weight * centre[p];
    }
    return mask;
  }
};

}  // namespace
}  // namespace eigenpose
