#include "core/base/worker_threads.h"

#include <algorithm>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

// oneTBB's library is not built for the thread sanitizer, which would take its hand-overs for races. With
// that sanitizer, this file is compiled without it and tells it of each hand-over.
#ifdef EIGENPOSE_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

namespace eigenpose::detail {
namespace {

void tell_released([[maybe_unused]] void* context) {
#ifdef EIGENPOSE_THREAD_SANITIZER
  __tsan_release(context);
#endif
}

void tell_acquired([[maybe_unused]] void* context) {
#ifdef EIGENPOSE_THREAD_SANITIZER
  __tsan_acquire(context);
#endif
}

}  // namespace

void call_on_threads(std::size_t threads, void (*work)(void* context), void* context) {
  // oneTBB warns on stderr about arenas with more slots than it has threads.
  const std::size_t slots =
      std::min(threads, tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  tbb::task_arena arena(static_cast<int>(slots));  // no more threads than its slots enter it
  tell_released(context);
  arena.execute([&] {
    tbb::parallel_for(
        std::size_t{0}, slots,
        [&](std::size_t) {
          tell_acquired(context);
          work(context);
          tell_released(context);
        },
        tbb::simple_partitioner());
  });
  tell_acquired(context);
}

}  // namespace eigenpose::detail
