#pragma once

/// Calling one function on several of oneTBB's threads. Internal to parallel.cpp.

#include <cstddef>

namespace eigenpose::detail {

/// Calls `work(context)` at most `threads` times, at the same time as far as the machine has cores, once of
/// them on the calling thread. Each call sees what the caller wrote before; the caller then sees what they
/// wrote.
/// @pre `work` throws nothing.
void call_on_threads(std::size_t threads, void (*work)(void* context), void* context);

}  // namespace eigenpose::detail
