/// Loops over few vectors, unrolled. Included once per target, after highway.h.

#include <cstddef>
#include <utility>

#include <hwy/highway.h>

#if defined(EIGENPOSE_SIMD_UNROLL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef EIGENPOSE_SIMD_UNROLL_INL_H
#undef EIGENPOSE_SIMD_UNROLL_INL_H
#else
#define EIGENPOSE_SIMD_UNROLL_INL_H
#endif

/// Before the body of a lambda that `unroll` calls: it is inlined, so that what it captures stays in
/// registers.
#ifndef EIGENPOSE_INLINE_LAMBDA
#define EIGENPOSE_INLINE_LAMBDA __attribute__((always_inline))
#endif

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {

template <std::size_t... indices, class F>
HWY_INLINE void unroll_each(std::index_sequence<indices...> /*indices*/, F&& body) {
  (body(std::integral_constant<std::size_t, indices>()), ...);
}

/// body(0) … body(count − 1), each with a constant: an array indexed by it becomes registers.
template <std::size_t count, class F>
HWY_INLINE void unroll(F&& body) {
  unroll_each(std::make_index_sequence<count>(), std::forward<F>(body));
}

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#endif
