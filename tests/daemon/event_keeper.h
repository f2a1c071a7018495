#pragma once

/// A sink that keeps the events it is given, and lets a test wait for them.

#include <condition_variable>
#include <mutex>
#include <variant>
#include <vector>

#include "daemon/service/events.h"

namespace eigenpose {

/// Thread-safe.
class EventKeeper final : public EventSink {
 public:
  void publish(const Event& event) noexcept override {
    const std::lock_guard lock(mutex_);
    events_.push_back(event);
    changed_.notify_all();
  }
  /// Every event of this type so far.
  template <typename Kind>
  std::vector<Kind> all() {
    const std::lock_guard lock(mutex_);
    return select<Kind>();
  }
  /// Waits until so many of this type have come. @return them.
  template <typename Kind>
  std::vector<Kind> first(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return select<Kind>().size() >= count; });
    return select<Kind>();
  }

 private:
  template <typename Kind>
  std::vector<Kind> select() const {
    std::vector<Kind> chosen;
    for (const Event& event : events_)
      if (const auto* kind = std::get_if<Kind>(&event)) chosen.push_back(*kind);
    return chosen;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Event> events_;  ///< guarded by mutex_
};

}  // namespace eigenpose
