#pragma once

/// Time as the library and the drivers see it: monotonic, injected, interruptible.

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>

namespace eigenpose {

/// CLOCK_MONOTONIC on Linux: the clock that V4L2 stamps its buffers with.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// Where "now" comes from. Thread-safe.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual TimePoint now() const = 0;
  /// Sleeps until `when` or until `stop` is requested, whichever is first.
  /// @return true if `when` was reached, false if interrupted.
  virtual bool sleep_until(TimePoint when, std::stop_token stop) const = 0;

  bool sleep_for(Duration duration, std::stop_token stop = {}) const {
    return sleep_until(now() + duration, std::move(stop));
  }

 protected:
  Clock() = default;
  Clock(const Clock&) = default;
  Clock& operator=(const Clock&) = default;
};

/// The machine's monotonic clock.
class SteadyClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const override { return std::chrono::steady_clock::now(); }
  bool sleep_until(TimePoint when, std::stop_token stop) const override;
};

/// A clock that moves only when told to: for tests. Sleepers wake when `advance` passes their time.
class ManualClock final : public Clock {
 public:
  explicit ManualClock(TimePoint start = TimePoint{}) : now_(start) {}
  [[nodiscard]] TimePoint now() const override;
  bool sleep_until(TimePoint when, std::stop_token stop) const override;
  void advance(Duration by);

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable_any moved_;
  TimePoint now_;  ///< guarded by mutex_
};

}  // namespace eigenpose
