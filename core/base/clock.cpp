#include "core/base/clock.h"

namespace eigenpose {

bool SteadyClock::sleep_until(TimePoint when, std::stop_token stop) const {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_until(lock, stop, when, [] { return false; });
  return !stop.stop_requested();
}

TimePoint ManualClock::now() const {
  const std::lock_guard lock(mutex_);
  return now_;
}

bool ManualClock::sleep_until(TimePoint when, std::stop_token stop) const {
  std::unique_lock lock(mutex_);
  moved_.wait(lock, stop, [&] { return now_ >= when; });
  return !stop.stop_requested();
}

void ManualClock::advance(Duration by) {
  {
    const std::lock_guard lock(mutex_);
    now_ += by;
  }
  moved_.notify_all();
}

}  // namespace eigenpose
