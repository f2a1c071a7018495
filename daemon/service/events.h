#pragma once

/// What the service publishes, as values. Whoever sends them on (a socket, a file, a broker) makes text of
/// them.

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/base/clock.h"
#include "core/model/model.h"
#include "core/recognition/outcome.h"
#include "core/recognition/recognizer.h"
#include "daemon/service/job_status.h"

namespace eigenpose {

/// Which frame a result is about.
struct FrameReference {
  std::uint64_t sequence = 0;  ///< the camera's number of it
  TimePoint exposure_start{};  ///< on the monotonic clock
};

/// The scene settled and was recognised, or it began to change.
struct SceneResult {
  enum class State { settled, changing };
  State state = State::settled;
  FrameReference frame;
  std::chrono::system_clock::time_point time;  ///< when it was published
  std::shared_ptr<const Model> model;          ///< the outcomes' objects and DOFs; null while changing
  std::vector<Outcome> outcomes;               ///< empty while changing, and for an empty table
  std::optional<RecognitionTimes> times;       ///< none while changing
};

/// The workspace of an object of `result.model`; null when there is none of that name.
const Workspace* workspace_of(const SceneResult& result, std::string_view object);

/// The result in a few words for the log: "verdict=recognized object=mug table_deg=12.3".
std::string log_text(const SceneResult& result);

/// There are no frames at the moment.
struct CameraLost {
  std::string error;
};
/// Frames come, for the first time or again.
struct CameraFound {};

/// A job has started or ended. Progress is not an event: ask for it.
struct JobChanged {
  JobStatus job;
};

using Event = std::variant<SceneResult, CameraLost, CameraFound, JobChanged>;

/// Takes events. `publish` is called on the thread where the event happened, from several threads at once: it
/// must be thread-safe and quick, and must not wait for a reader.
class EventSink {
 public:
  virtual ~EventSink() = default;
  virtual void publish(const Event& event) noexcept = 0;

 protected:
  EventSink() = default;
  EventSink(const EventSink&) = default;
  EventSink& operator=(const EventSink&) = default;
};

}  // namespace eigenpose
