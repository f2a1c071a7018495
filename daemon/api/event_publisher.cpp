#include "daemon/api/event_publisher.h"

#include <exception>
#include <string_view>
#include <variant>

#include <spdlog/spdlog.h>

#include "core/base/printable.h"
#include "daemon/api/result_json.h"

namespace eigenpose {

EventPublisher::EventPublisher(std::size_t capacity) : results_(std::make_shared<EventLog>(capacity)) {}

void EventPublisher::publish(const Event& event) noexcept {
  const auto add = [this](std::string_view name, const auto& make) {
    results_->publish(name, [&](std::uint64_t sequence) {
      return make(EventNumber{sequence, results_->run()});
    });
  };
  try {
    if (const auto* result = std::get_if<SceneResult>(&event))
      add("result", [&](const EventNumber& number) { return result_json(*result, number); });
    else if (const auto* lost = std::get_if<CameraLost>(&event))
      add("camera_lost", [&](const EventNumber& number) { return camera_lost_json(*lost, number); });
    else if (std::holds_alternative<CameraFound>(event))
      add("camera_found", [](const EventNumber& number) { return camera_found_json(number); });
  } catch (const std::exception& error) {
    spdlog::error("event=publishing_failed error=\"{}\"", printable(error.what()));
  }
}

}  // namespace eigenpose
