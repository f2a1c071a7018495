#pragma once

/// Calling one function on several of oneTBB's threads. Internal to parallel.cpp.

#include <cstddef>

namespace eigenpose::detail {

/// Calls `work(context)` at most `threads` times, at the same time as far as the machine has cores, once of
/// them on the calling thread. @pre `work` throws nothing.
///
/// oneTBB's library is not built for the thread sanitizer, which therefore cannot see how tasks are handed
/// over: the source of this function is compiled without it. `work` must begin by acquiring what the caller
/// released into the context, and end by releasing what the caller acquires (atomics).
void call_on_threads(std::size_t threads, void (*work)(void* context), void* context);

}  // namespace eigenpose::detail
