#pragma once

/// What eigenposed does, put together: devices, watching, jobs, and what the API may ask of them.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/clock.h"
#include "core/image/frame.h"
#include "core/learning/learning.h"
#include "daemon/rig/acquisition.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/heartbeat.h"
#include "daemon/rig/plan.h"
#include "daemon/rig/rig.h"
#include "daemon/service/events.h"
#include "daemon/service/image_set_catalog.h"
#include "daemon/service/jobs.h"
#include "daemon/service/model_store.h"
#include "daemon/service/watcher.h"

namespace eigenpose {

/// One object: acquired, learned, or both.
struct ObjectStatus {
  std::string name;
  struct Acquired {
    std::size_t views = 0;
    bool complete = false;
  };
  std::optional<Acquired> acquired;
  std::optional<std::string> error;       ///< why its image set cannot be read, or that there are two
  std::optional<std::size_t> learned_as;  ///< index into the model's objects
};

/// Learning's own settings, each as `ServiceOptions::learning` says unless given.
struct LearnRequest {
  std::optional<int> components;     ///< 1…1024
  std::vector<std::string> objects;  ///< empty: all whose image set is complete
};

/// The newest frame and how old it is.
struct NewestFrame {
  Frame frame;
  Duration age{};  ///< since its exposure began
};

/// What the service works with, beside its devices.
struct ServiceOptions {
  std::vector<Plan> plans;           ///< made for the rig's axes
  std::filesystem::path image_sets;  ///< folder of the image sets
  std::filesystem::path model_file;
  WatcherOptions watch;
  /// A camera that is found to be grey makes learning grey where this says colour.
  LearningOptions learning;
  Duration stale_frame = std::chrono::seconds(10);  ///< an older frame is not handed out
};

/// The devices that the configuration names, not opened yet.
struct ServiceDevices {
  FrameHub::OpenCamera camera;  ///< empty: none
  std::vector<RigAxis> axes;
  std::vector<RigLamp> lamps;
};

enum class ServiceState { acquiring, watching, idle };
/// What the service does, and since when.
struct ServiceActivity {
  ServiceState state = ServiceState::idle;
  std::chrono::system_clock::time_point since;  ///< the job's start, or the service's
};
/// "acquiring", "watching", "idle": stable names.
std::string_view service_state_name(ServiceState state);

/// The running service. Construction starts it in the order of the members; destruction stops it in reverse:
/// first nobody asks, then jobs end, motion stops, devices close. Thread-safe, and no call blocks on a
/// device.
class Service {
 public:
  /// What is passed by reference outlives the service.
  Service(ServiceOptions options, ServiceDevices devices, EventSink& events, Heartbeat& heartbeat,
          const Clock& clock);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service();

  /// Starts an acquisition. Everything that can be known beforehand is refused here, before a job is made:
  /// @throws ServiceError (invalid_request: a name that cannot be; conflict: a complete set of that name, or
  /// an unfinished one of another workspace; busy), ConfigError for a plan that the axes cannot follow.
  JobStatus acquire(const std::string& object, const PlanRequest& plan);
  /// The same with the configured plan of that name. @throws ServiceError (not_found) too.
  JobStatus acquire(const std::string& object, const std::string& plan_name);
  /// Starts learning the image sets that are named, or else all that are complete; the model is saved, then
  /// swapped in. The job fails as `conflict`, and the former model stays, where an object that is named, or
  /// that the former model knows and has an image set, would not be in the new one; what else is left out
  /// stands in its result. @throws ServiceError (invalid_request, busy; not_found; conflict: a set that is
  /// named, or whose object the model in use knows, is incomplete, unreadable or there twice; none is
  /// complete).
  JobStatus learn(const LearnRequest& request);
  /// Stops all motion now, then cancels the acquisition that runs. Never throws.
  void stop_motion() noexcept;

  /// As of a few seconds ago; reads no file.
  [[nodiscard]] std::vector<ObjectStatus> objects() const;
  /// @throws ServiceError (unavailable) when there is none, or it is older than `stale_frame`.
  [[nodiscard]] NewestFrame newest_frame() const;
  /// Whether the result about that frame (FrameReference::sequence) says what the newest frame shows: the
  /// last one published, while neither an acquisition nor a failure of camera or recognition came after it.
  [[nodiscard]] bool is_current(std::uint64_t result_frame) const;
  /// The time since a frame's exposure began.
  [[nodiscard]] Duration age_of(TimePoint exposure_start) const { return clock_.now() - exposure_start; }
  /// Idle when watching is off or there is no model.
  [[nodiscard]] ServiceActivity activity() const;

  [[nodiscard]] const std::vector<Plan>& plans() const { return options_.plans; }
  [[nodiscard]] std::chrono::system_clock::time_point started() const { return started_; }
  [[nodiscard]] const ModelStore& models() const { return models_; }
  [[nodiscard]] const FrameHub& camera() const { return camera_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Watcher& watcher() const { return watcher_; }
  [[nodiscard]] Jobs& jobs() { return jobs_; }

 private:
  JobStatus start_acquisition(const std::string& object, Plan plan);
  void refuse_set_in_the_way(const std::string& object, const Workspace& workspace);
  void refuse_what_cannot_be_learned(const std::vector<std::string>& objects);
  JobResult run_acquisition(const AcquisitionRequest& request, const Jobs::Context& job);
  JobResult run_learning(LearningOptions options, const std::vector<std::string>& wanted,
                         const Jobs::Context& job);

  const ServiceOptions options_;
  const Clock& clock_;
  const std::chrono::system_clock::time_point started_ = std::chrono::system_clock::now();
  const std::vector<Dof> dofs_;  ///< of all axes
  ModelStore models_;
  ImageSetCatalog image_sets_;
  Rig rig_;
  FrameHub camera_;
  Watcher watcher_;
  Jobs jobs_;
};

}  // namespace eigenpose
