#include "core/base/worker_threads.h"

#include <algorithm>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

namespace eigenpose::detail {

void call_on_threads(std::size_t threads, void (*work)(void* context), void* context) {
  // oneTBB warns on stderr about arenas with more slots than it has threads.
  const std::size_t slots =
      std::min(threads, tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  tbb::task_arena arena(static_cast<int>(slots));  // no more threads than its slots enter it
  arena.execute([&] {
    tbb::parallel_for(
        std::size_t{0}, slots, [&](std::size_t) { work(context); }, tbb::simple_partitioner());
  });
}

}  // namespace eigenpose::detail
