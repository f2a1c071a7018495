#include "daemon/api/event_publisher.h"

#include <exception>

#include <spdlog/spdlog.h>

#include "daemon/api/result_json.h"

namespace eigenpose {

EventPublisher::EventPublisher(std::size_t capacity) : results_(std::make_shared<EventLog>(capacity)) {}

void EventPublisher::publish(const Event& event) noexcept {
  const auto* result = std::get_if<SceneResult>(&event);
  if (result == nullptr) return;  // only results have a stream
  try {
    results_->publish([&](std::uint64_t sequence) { return result_json(*result, sequence); });
  } catch (const std::exception& error) {
    spdlog::error("event=publishing_failed error=\"{}\"", error.what());
  }
}

}  // namespace eigenpose
