#pragma once

/// Counts what a program takes from the heap. A program that has counted_memory.cpp among its sources
/// replaces operator new and delete, all of them: otherwise a sanitizer's own would meet ours.

#include <atomic>

namespace eigenpose::testing {

/// Calls of operator new so far.
extern std::atomic<long> allocations;

}  // namespace eigenpose::testing
