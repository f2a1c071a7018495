#pragma once

/// Long work that clients start, watch and cancel.

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "core/base/progress.h"
#include "daemon/rig/heartbeat.h"
#include "daemon/service/events.h"
#include "daemon/service/job_status.h"

namespace eigenpose {

/// Between two reports of a job's progress. The longest step without one is the eigen-solve of a large set.
inline constexpr std::chrono::minutes job_step_limit{30};

/// Runs jobs, each on a thread of its own, one of each kind at a time. Remembers the last hundred.
/// Thread-safe.
class Jobs {
 public:
  /// What a job is given.
  struct Context {
    Progress progress;
    std::stop_token stop;
    /// If the job does not end as done, this stands in its failure behind the failure's own hint.
    std::function<void(std::string)> add_hint;
  };
  /// Does the work and returns its result. Failures leave as exceptions.
  using Work = std::function<JobResult(const Context&)>;

  /// Starts a thread that runs the body. @throws std::system_error when the system has none left.
  using StartThread = std::function<std::jthread(std::function<void(const std::stop_token&)>)>;

  /// @param events hears of each start and end. Both outlive the jobs.
  Jobs(EventSink& events, Heartbeat& heartbeat);
  Jobs(EventSink& events, Heartbeat& heartbeat, StartThread start_thread);
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;
  /// Cancels what runs and waits for it.
  ~Jobs();

  /// @return the job, running; or failed, when no thread could be started for it.
  /// @throws ServiceError (busy) when a job of that kind is running.
  JobStatus start(JobKind kind, const std::string& subject, Work work);
  [[nodiscard]] std::optional<JobStatus> find(const std::string& id) const;
  [[nodiscard]] std::vector<JobStatus> list() const;  ///< oldest first
  [[nodiscard]] std::optional<JobStatus> running(JobKind kind) const;
  /// Asks the job to stop; it ends soon after as cancelled. @return its status; nothing if there is no such
  /// job.
  std::optional<JobStatus> cancel(const std::string& id);

 private:
  struct Job {
    mutable std::mutex mutex;
    JobStatus status;        ///< guarded by mutex
    std::string extra_hint;  ///< guarded by mutex
    std::jthread thread;
  };
  void run(Job& job, const Work& work, const std::stop_token& stop);
  void end(Job& job, JobState state, JobResult result, std::optional<Failure> failure);
  void forget_old();

  EventSink& events_;
  Heartbeat& heartbeat_;
  const StartThread start_thread_;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, std::shared_ptr<Job>> jobs_;  ///< guarded by mutex_
  std::uint64_t next_id_ = 1;                           ///< guarded by mutex_
};

}  // namespace eigenpose
