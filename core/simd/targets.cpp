#include "core/simd/targets.h"

#include <stdexcept>

// clang-format off
#include "core/simd/compiled_targets.h"
#include <hwy/highway.h>
// clang-format on

namespace eigenpose {

namespace {

/// Never empty: where no target is known to be supported, kernels use the one that the compiler's flags
/// promise.
std::vector<std::int64_t> usable_targets() {
  std::vector<std::int64_t> found = hwy::SupportedAndGeneratedTargets();
  if (found.empty()) found.push_back(HWY_STATIC_TARGET);
  return found;
}

}  // namespace

std::vector<std::string> simd_targets() {
  std::vector<std::string> names;
  for (const std::int64_t target : usable_targets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

OnlySimdTarget::OnlySimdTarget(std::string_view name) {
  std::string known;
  for (const std::int64_t target : usable_targets()) {
    if (name == hwy::TargetName(target)) {
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().Update(target);
      return;
    }
    known += std::string(" ") + hwy::TargetName(target);
  }
  throw std::invalid_argument("no SIMD target " + std::string(name) + " here; there are:" + known);
}

OnlySimdTarget::~OnlySimdTarget() {
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace eigenpose
