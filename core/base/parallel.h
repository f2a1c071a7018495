#pragma once

/// Spreading independent work over the cores.

#include <cstddef>
#include <functional>

namespace eigenpose {

/// Calls `work(i)` once for every i in [0, count), on `threads` threads (0: all cores), the calling one among
/// them. Chunks are handed out one by one, so uneven work balances. The first exception thrown is thrown
/// again here, after all threads have ended. `work` must not depend on the order.
void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work);

/// The number that `threads` stands for: itself, or the cores of the machine for 0.
unsigned resolved_threads(unsigned threads);

}  // namespace eigenpose
