#pragma once

/// How long work reports that it goes on.

#include <cstddef>
#include <functional>
#include <string_view>

namespace eigenpose {

/// One step of long work: `done` of `total` units of `stage` are finished.
struct ProgressUpdate {
  std::string_view stage;  ///< short, present participle: "normalising", "eigen-solve"
  std::size_t done = 0;
  std::size_t total = 0;
};

/// Called often, from whichever thread works, one call at a time (see WorkMeter); must be quick and must not
/// throw. Empty means nobody listens.
using Progress = std::function<void(const ProgressUpdate&)>;

}  // namespace eigenpose
