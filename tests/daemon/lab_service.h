#pragma once

/// The whole service on a simulated lab, in the test's own process.

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "config/config.h"
#include "core/base/clock.h"
#include "daemon/service/service.h"
#include "sim/lab/lab_client.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

/// Starts the service with a configuration to which the folders of the test are added. What the test waits
/// for comes from the service itself; only ctest's own limit ends a wait for something that never comes.
class LabService {
 public:
  explicit LabService(const std::string& configuration)
      : config_(parse_config("[daemon]\nruntime_dir = \"run\"\nstate_dir = \"state\"\n" + configuration,
                             folder_.path() / "rig.toml")) {
    std::filesystem::create_directories(config_.daemon.runtime_dir);
    std::filesystem::create_directories(config_.daemon.state_dir);
    service_ = std::make_unique<Service>(config_, make_devices(config_, clock_), clock_);
    service_->results()->on_publish([this] {
      const std::lock_guard lock(mutex_);
      published_.notify_all();
    });
    if (config_.sim) lab_ = std::make_unique<sim::LabClient>(config_.lab_socket());
  }
  ~LabService() { service_->results()->on_publish({}); }
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
    return ended(service_->acquire(object, service_->plan("default")).id);
  }
  JobStatus learn() { return ended(service_->learn({}).id); }

  /// The first settled result of a frame exposed after `since`.
  nlohmann::json settled_after(TimePoint since) {
    const double since_s = std::chrono::duration<double>(since.time_since_epoch()).count();
    std::unique_lock lock(mutex_);
    nlohmann::json result;
    published_.wait(lock, [&] {
      const auto latest = service_->results()->latest();
      if (!latest) return false;
      result = nlohmann::json::parse(*latest->data);
      return result.at("state") == "settled" && result.at("exposure_monotonic_s").get<double>() > since_s;
    });
    return result;
  }
  /// What the service says of the table after `change`.
  template <typename Change>
  nlohmann::json seen_after(Change change) {
    change();
    return settled_after(clock_.now());
  }

 private:
  test::TemporaryFolder folder_;
  SteadyClock clock_;
  Config config_;
  std::unique_ptr<Service> service_;
  std::unique_ptr<sim::LabClient> lab_;
  std::mutex mutex_;
  std::condition_variable published_;
};

}  // namespace eigenpose
