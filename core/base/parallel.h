#pragma once

/// Spreading independent work over the cores, on oneTBB's threads.

#include <cstddef>
#include <functional>

namespace eigenpose {

/// Calls `work(i)` once for every i in [0, count), on at most `threads` threads (0: all cores), the calling
/// one among them; there may be fewer where the machine has fewer cores. Indices are handed out one by one in
/// ascending order, so that uneven work balances and what is read in sequence stays in sequence. Returns when
/// all calls have ended. The first exception thrown is thrown again here; after it, nothing new is begun.
///
/// The result must not depend on the order of the calls. `work` may call parallel_for itself; it must not
/// wait for another index's call, nor hold a lock while it calls parallel_for.
void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work);

/// The number that `threads` stands for: itself, or the cores of the machine for 0.
unsigned resolved_threads(unsigned threads);

}  // namespace eigenpose
