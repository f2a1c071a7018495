#pragma once

/// What eigenposed does, put together: devices, watching, jobs, and what the API may ask of them.

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/clock.h"
#include "core/image/frame.h"
#include "core/learning/learning.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/plan.h"
#include "daemon/rig/rig.h"
#include "daemon/service/events.h"
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
  std::optional<std::string> trouble;     ///< why its image set cannot be read
  std::optional<std::size_t> learned_as;  ///< index into the model's objects
};

/// Learning's own settings, each as `ServiceOptions::learning` says unless given.
struct LearnRequest {
  std::optional<int> components;     ///< 1…1024
  std::vector<std::string> objects;  ///< empty: all whose image set is complete
};

/// What the service works with, beside its devices.
struct ServiceOptions {
  std::vector<Plan> plans;           ///< made for the rig's axes
  std::filesystem::path image_sets;  ///< folder of the image sets
  std::filesystem::path model_file;
  WatcherOptions watch;
  LearningOptions learning;
};

/// The devices that the configuration names, not opened yet.
struct ServiceDevices {
  FrameHub::OpenCamera camera;  ///< empty: none
  std::vector<RigAxis> axes;
  std::vector<RigLamp> lamps;
};

enum class ServiceState { acquiring, watching, idle };
/// "acquiring", "watching", "idle": stable names.
std::string_view service_state_name(ServiceState state);

/// The running service. Construction starts it in the order of the members; destruction stops it in reverse:
/// first nobody asks, then jobs end, motion stops, devices close. Thread-safe, and no call blocks on a
/// device.
class Service {
 public:
  /// The clock and `events` outlive the service.
  Service(ServiceOptions options, ServiceDevices devices, EventSink& events, const Clock& clock);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service();

  /// Starts an acquisition. @throws ServiceError (busy), ConfigError for a plan that the axes cannot follow.
  JobStatus acquire(const std::string& object, const PlanRequest& plan);
  /// The same with the configured plan of that name. @throws ServiceError (not_found) too.
  JobStatus acquire(const std::string& object, const std::string& plan_name);
  /// Starts learning all complete image sets; the model is saved, then swapped in. @throws ServiceError
  /// (busy, invalid_request).
  JobStatus learn(const LearnRequest& request);

  [[nodiscard]] std::vector<ObjectStatus> objects() const;
  /// @throws ServiceError (unavailable) when there is none.
  [[nodiscard]] Frame newest_frame() const;
  /// Idle when watching is off or there is no model.
  [[nodiscard]] ServiceState state() const;

  [[nodiscard]] const std::vector<Plan>& plans() const { return options_.plans; }
  [[nodiscard]] std::chrono::system_clock::time_point started() const { return started_; }
  [[nodiscard]] const ModelStore& models() const { return models_; }
  [[nodiscard]] const FrameHub& camera() const { return camera_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Watcher& watcher() const { return watcher_; }
  [[nodiscard]] Jobs& jobs() { return jobs_; }

 private:
  JobStatus start_acquisition(const std::string& object, Plan plan);

  const ServiceOptions options_;
  const Clock& clock_;
  const std::chrono::system_clock::time_point started_ = std::chrono::system_clock::now();
  const std::vector<Dof> dofs_;  ///< of all axes
  ModelStore models_;
  Rig rig_;
  FrameHub camera_;
  Watcher watcher_;
  Jobs jobs_;
};

}  // namespace eigenpose
