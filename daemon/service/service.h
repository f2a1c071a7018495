#pragma once

/// What eigenposed does, put together: devices, watching, jobs, and what the API may ask of them.

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/config.h"
#include "core/base/clock.h"
#include "core/image/frame.h"
#include "daemon/api/event_log.h"
#include "daemon/devices.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/rig.h"
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

/// Learning's own settings, each taken from the configuration unless given.
struct LearnRequest {
  std::optional<int> components;
  std::vector<std::string> objects;  ///< empty: all whose image set is complete
};

/// The running service. Construction starts it in the order of the members; destruction stops it in reverse:
/// first nobody asks, then jobs end, motion stops, devices close. Thread-safe, and no call blocks on a
/// device.
class Service {
 public:
  /// @throws ConfigError, FileError.
  Service(Config config, Devices devices, const Clock& clock);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service();

  /// Starts an acquisition. @throws RequestError (409 running or complete already, 400 bad name),
  /// ConfigError.
  JobStatus acquire(const std::string& object, const Plan& plan);
  /// Starts learning all complete image sets; the model is saved, then swapped in. @throws RequestError (409
  /// running).
  JobStatus learn(const LearnRequest& request);
  /// The configured plan of that name. @throws RequestError (404).
  [[nodiscard]] const Plan& plan(const std::string& name) const;

  [[nodiscard]] std::vector<ObjectStatus> objects() const;
  /// The newest frame as JPEG. @throws RequestError (503) when there is none.
  [[nodiscard]] std::string frame_jpeg() const;
  /// "acquiring", "watching", or "idle" when watching is off or impossible.
  [[nodiscard]] std::string state() const;

  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const std::optional<SimulationInfo>& simulation() const { return devices_.simulation; }
  [[nodiscard]] std::chrono::system_clock::time_point started() const { return started_; }
  [[nodiscard]] const ModelStore& models() const { return models_; }
  [[nodiscard]] const FrameHub& camera() const { return camera_; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const Watcher& watcher() const { return watcher_; }
  [[nodiscard]] const std::shared_ptr<EventLog>& results() const { return results_; }
  [[nodiscard]] Jobs& jobs() { return jobs_; }

 private:
  const Config config_;
  const Clock& clock_;
  const std::chrono::system_clock::time_point started_ = std::chrono::system_clock::now();
  Devices devices_;
  ModelStore models_;
  std::shared_ptr<EventLog> results_;
  Rig rig_;
  FrameHub camera_;
  Watcher watcher_;
  Jobs jobs_;
};

}  // namespace eigenpose
