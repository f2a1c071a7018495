#pragma once

/// The instruction sets (Highway calls them targets) of the vector kernels. Each kernel is compiled once per
/// target; at run time the best one that the processor has is used. Nothing has to be called for that: these
/// functions serve reports, tests and benchmarks.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace eigenpose {

/// Names of the targets that are compiled in and that this processor can run, best first: on x86-64 "AVX2",
/// "SSE4", "SCALAR", on AArch64 "NEON". The portable code ("SCALAR" or "EMU128") is the last one; it is left
/// out where the compiler's flags promise better, unless HWY_COMPILE_ALL_ATTAINABLE is defined. Thread-safe.
std::vector<std::string> simd_targets();

/// While it lives, every kernel of the process uses one target. One at a time; made and destroyed while no
/// other thread runs a kernel. For tests and benchmarks.
class OnlySimdTarget {
 public:
  /// @param name one of `simd_targets()`. @throws std::invalid_argument with the names that there are.
  explicit OnlySimdTarget(std::string_view name);
  ~OnlySimdTarget();
  OnlySimdTarget(const OnlySimdTarget&) = delete;
  OnlySimdTarget& operator=(const OnlySimdTarget&) = delete;
};

}  // namespace eigenpose
