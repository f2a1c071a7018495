#pragma once

/// The whole service on a simulated lab, in the test's own process.

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>

#include "config/config.h"
#include "core/base/clock.h"
#include "daemon/composition.h"
#include "daemon/devices.h"
#include "daemon/service/service.h"
#include "sim/lab/lab_client.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

/// Starts the service with a configuration to which the folders of the test are added. What the test waits
/// for comes from the service itself; only ctest's own limit ends a wait for something that never comes.
class LabService final : public EventSink {
 public:
  explicit LabService(const std::string& configuration)
      : config_(parse_config("[daemon]\nruntime_dir = \"run\"\nstate_dir = \"state\"\n" + configuration,
                             folder_.path() / "rig.toml")) {
    std::filesystem::create_directories(config_.daemon.runtime_dir);
    std::filesystem::create_directories(config_.daemon.state_dir);
    const Devices devices = make_devices(config_, clock_);
    service_ = std::make_unique<Service>(service_options(config_),
                                         ServiceDevices{devices.camera, devices.axes, devices.lamps}, *this,
                                         heartbeat_, clock_);
    if (config_.sim) lab_ = std::make_unique<sim::LabClient>(config_.lab_socket());
  }
  LabService(const LabService&) = delete;
  LabService& operator=(const LabService&) = delete;

  [[nodiscard]] Service& service() { return *service_; }
  [[nodiscard]] sim::LabClient& lab() { return *lab_; }
  [[nodiscard]] const Config& config() const { return config_; }

  /// Waits until the job has ended.
  JobStatus ended(const std::string& id) {
    for (;;) {
      const JobStatus job = service_->jobs().find(id).value();
      if (job.state != JobState::running) return job;
      clock_.sleep_for(std::chrono::milliseconds(2));
    }
  }
  /// Waits until the job has done so many steps or has ended.
  JobStatus done_steps(const std::string& id, std::size_t steps) {
    for (;;) {
      const JobStatus job = service_->jobs().find(id).value();
      if (job.state != JobState::running || job.done >= steps) return job;
      clock_.sleep_for(std::chrono::milliseconds(2));
    }
  }
  JobStatus acquire(const std::string& object) {
    lab_->clear();
    lab_->place(object);
    return ended(service_->acquire(object, "default").id);
  }
  JobStatus learn() { return ended(service_->learn({}).id); }

  /// The first settled result of a frame exposed after `since`.
  SceneResult settled_after(TimePoint since) {
    std::unique_lock lock(mutex_);
    published_.wait(lock, [&] { return settled_ && settled_->frame.exposure_start > since; });
    return *settled_;
  }
  /// What the service reports of the table after `change`.
  template <typename Change>
  SceneResult seen_after(Change change) {
    change();
    return settled_after(clock_.now());
  }

 private:
  void publish(const Event& event) noexcept override {
    const auto* result = std::get_if<SceneResult>(&event);
    if (result == nullptr || result->state != SceneResult::State::settled) return;
    const std::lock_guard lock(mutex_);
    settled_ = *result;
    published_.notify_all();
  }

  test::TemporaryFolder folder_;
  SteadyClock clock_;
  Heartbeat heartbeat_{clock_};
  Config config_;
  std::mutex mutex_;
  std::condition_variable published_;
  std::optional<SceneResult> settled_;  ///< guarded by mutex_: the newest
  std::unique_ptr<Service> service_;
  std::unique_ptr<sim::LabClient> lab_;
};

}  // namespace eigenpose
