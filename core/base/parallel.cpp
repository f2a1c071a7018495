#include "core/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include "core/base/worker_threads.h"

namespace eigenpose {
namespace {

/// What the threads of one parallel_for share.
struct Shared {
  std::size_t count;
  const std::function<void(std::size_t)>& work;
  std::atomic<std::size_t> next{0};
  std::mutex failure_mutex = {};
  std::exception_ptr failure = {};  ///< guarded by failure_mutex
};

void take_indices(void* context) {
  Shared& shared = *static_cast<Shared*>(context);
  try {
    for (std::size_t i = shared.next.fetch_add(1); i < shared.count; i = shared.next.fetch_add(1))
      shared.work(i);
  } catch (...) {
    shared.next = shared.count;  // nobody begins anything new
    const std::lock_guard lock(shared.failure_mutex);
    if (!shared.failure) shared.failure = std::current_exception();
  }
}

}  // namespace

unsigned resolved_threads(unsigned threads) {
  return threads > 0 ? threads : std::max(1U, std::thread::hardware_concurrency());
}

void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work) {
  const std::size_t workers = std::min<std::size_t>(resolved_threads(threads), count);
  if (workers <= 1) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  Shared shared{count, work};
  detail::call_on_threads(workers, &take_indices, &shared);
  if (shared.failure) std::rethrow_exception(shared.failure);
}

}  // namespace eigenpose
