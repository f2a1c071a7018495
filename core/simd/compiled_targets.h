#pragma once

/// What every kernel is compiled for. The first include of each kernel's .cpp file, before Highway's own
/// headers: all kernels are then compiled for the same targets, and `simd_targets()` names those.

/// Left out:
/// - AVX3, AVX3_DL (AVX-512): no machine of ours runs them, so no test would have run their code. AVX2 is
/// used there.
/// - SVE, SVE2: their vectors have no size at compile time, so no array can hold them. NEON is used there.
/// - SSSE3: processors that have it and not SSE4 are older than 2010; they run the portable code.
#define HWY_DISABLED_TARGETS \
  (HWY_AVX3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_SSSE3)
