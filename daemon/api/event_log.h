#pragma once

/// The last events, numbered, for any number of readers each at its own pace.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace eigenpose {

/// A ring of events. A reader asks for the next one after those it has seen; one that lags more than
/// `capacity` behind loses the oldest and learns how many. Publishing never waits for a reader. Thread-safe.
class EventLog {
 public:
  /// @param capacity events kept, ≥ 1.
  explicit EventLog(std::size_t capacity);
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  /// Names this run of the program, in which sequence numbers count from 1. Letters and digits.
  [[nodiscard]] const std::string& run() const { return run_; }

  struct Event {
    std::uint64_t sequence = 0;  ///< 1, 2, 3 …
    std::string_view name;       ///< "result"; of static storage
    std::shared_ptr<const std::string> data;
    std::uint64_t lost = 0;  ///< events between the reader's last one and this one that are no longer kept
  };

  /// Adds an event. @param name of static storage. @param make is given its sequence number and returns its
  /// text.
  std::uint64_t publish(std::string_view name, const std::function<std::string(std::uint64_t)>& make);

  /// The first event kept whose number is above `sequence`; nothing if there is none yet. A number beyond the
  /// last one (from a former run of the program) counts as 0.
  [[nodiscard]] std::optional<Event> after(std::uint64_t sequence) const;
  /// The last event of that name, also when it is older than those kept.
  [[nodiscard]] std::optional<Event> latest(std::string_view name) const;
  [[nodiscard]] std::uint64_t last_sequence() const;

  /// Ends a listener's subscription when it is destroyed; then no call of the listener is under way. The log
  /// outlives it.
  class Subscription {
   public:
    Subscription() = default;  ///< of nothing
    Subscription(Subscription&& other) noexcept;
    Subscription& operator=(Subscription&& other) noexcept;
    ~Subscription();

   private:
    friend class EventLog;
    Subscription(EventLog& log, std::uint64_t id) : log_(&log), id_(id) {}
    EventLog* log_ = nullptr;
    std::uint64_t id_ = 0;
  };

  /// Calls `listener` after each `publish`, on the publishing thread, while the subscription lives. It must
  /// be quick and must not subscribe or unsubscribe.
  [[nodiscard]] Subscription subscribe(std::function<void()> listener);

 private:
  const std::size_t capacity_;
  const std::string run_;
  mutable std::mutex mutex_;
  std::deque<Event> kept_;                    ///< guarded by mutex_
  std::map<std::string_view, Event> latest_;  ///< guarded by mutex_: by name
  std::uint64_t last_ = 0;                    ///< guarded by mutex_: number of kept_.back()
  std::mutex listener_mutex_;
  std::map<std::uint64_t, std::function<void()>> listeners_;  ///< guarded by listener_mutex_
  std::uint64_t next_listener_ = 1;                           ///< guarded by listener_mutex_
};

}  // namespace eigenpose
