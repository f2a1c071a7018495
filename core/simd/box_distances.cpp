#include "core/simd/box_distances.h"

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/box_distances.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <bool with_order>
HWY_INLINE std::uint32_t distances_to_boxes(const BoxSlice* slices, const float* point,
                                            std::size_t dimensions, float bound, BoxDistances& distances) {
  // Weight of the squared distance to the centre in the order. Near the root several boxes contain the point;
  // this takes the one it lies deepest in. (low − q) − (q − high) is twice the distance to the centre.
  constexpr float centre_weight = 0.02F * 0.25F;
  constexpr std::size_t dimensions_between_checks = 4;
  const hn::CappedTag<float, box_lanes> d;
  using V = hn::Vec<decltype(d)>;
  constexpr std::size_t lanes = hn::MaxLanes(d);
  constexpr std::size_t parts = box_lanes / lanes;

  V squared[parts];
  V centre[parts];
  unroll<parts>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
    squared[p] = hn::Zero(d);
    centre[p] = hn::Zero(d);
  });
  const V limit = hn::Set(d, bound);
  std::uint32_t mask = 0;
  std::size_t k = 0;
  do {
    const std::size_t to =
        dimensions - k > dimensions_between_checks ? k + dimensions_between_checks : dimensions;
    for (; k < to; ++k) {
      const V q = hn::Set(d, point[k]);
      unroll<parts>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
        const V below = hn::Sub(hn::Load(d, slices[k].low + p * lanes), q);
        const V above = hn::Sub(q, hn::Load(d, slices[k].high + p * lanes));
        const V outside = hn::Max(hn::Max(below, above), hn::Zero(d));
        squared[p] = hn::Add(squared[p], hn::Mul(outside, outside));
        if constexpr (with_order) {
          const V twice = hn::Sub(below, above);
          centre[p] = hn::Add(centre[p], hn::Mul(twice, twice));
        }
      });
    }
    mask = 0;
    unroll<parts>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, hn::Le(squared[p], limit), bits);
      mask |= static_cast<std::uint32_t>(bits[0]) << (p * lanes);
      if constexpr (lanes > 8) mask |= static_cast<std::uint32_t>(bits[1]) << (p * lanes + 8);
    });
  } while (mask != 0 && k < dimensions);
  unroll<parts>([&](auto p) EIGENPOSE_INLINE_LAMBDA {
    hn::Store(squared[p], d, distances.squared + p * lanes);
    if constexpr (with_order) {
      hn::Store(hn::Add(squared[p], hn::Mul(hn::Set(d, centre_weight), centre[p])), d,
                distances.order + p * lanes);
    }
  });
  return mask;
}

std::uint32_t box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                            BoxDistances& distances) {
  return distances_to_boxes<false>(slices, point, dimensions, bound, distances);
}

std::uint32_t ordered_box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions,
                                    float bound, BoxDistances& distances) {
  return distances_to_boxes<true>(slices, point, dimensions, bound, distances);
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(box_distances);
HWY_EXPORT(ordered_box_distances);

std::uint32_t box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions, float bound,
                            BoxDistances& distances) {
  return HWY_DYNAMIC_DISPATCH(box_distances)(slices, point, dimensions, bound, distances);
}

std::uint32_t ordered_box_distances(const BoxSlice* slices, const float* point, std::size_t dimensions,
                                    float bound, BoxDistances& distances) {
  return HWY_DYNAMIC_DISPATCH(ordered_box_distances)(slices, point, dimensions, bound, distances);
}

}  // namespace eigenpose
#endif
