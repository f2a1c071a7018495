#pragma once

/// The service's events as numbered lines of JSON, for the API's streams.

#include <cstddef>
#include <memory>

#include "daemon/api/event_log.h"
#include "daemon/service/events.h"

namespace eigenpose {

/// Thread-safe. Outlives the service that publishes to it.
class EventPublisher final : public EventSink {
 public:
  /// @param capacity results kept for slow readers, ≥ 1.
  explicit EventPublisher(std::size_t capacity);

  void publish(const Event& event) noexcept override;

  /// What was seen, and when the camera was lost and found; never null.
  [[nodiscard]] const std::shared_ptr<EventLog>& results() const { return results_; }

 private:
  const std::shared_ptr<EventLog> results_;
};

}  // namespace eigenpose
