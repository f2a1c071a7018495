#pragma once

/// The box kernels of this processor.

#include <vector>

#include "core/simd/box_kernel.h"

namespace eigenpose {

/// The fastest kernel of this processor. All kernels add in the same order without fused operations, so that
/// they give the same bits.
BoxKernel box_kernel();

struct NamedBoxKernel {
  const char* name;
  BoxKernel kernel;
};
/// Every kernel that this processor can run, slowest first.
std::vector<NamedBoxKernel> box_kernels();

}  // namespace eigenpose
