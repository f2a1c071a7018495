#pragma once

/// Long work that clients start, watch and cancel.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/base/progress.h"

namespace eigenpose {

enum class JobState { running, done, failed, cancelled };
/// "running", "done", "failed", "cancelled": stable names used in JSON.
std::string_view job_state_name(JobState state);

/// A job as it stands at one moment.
struct JobStatus {
  std::string id;       ///< "1", "2", …
  std::string kind;     ///< "acquire", "learn"
  std::string subject;  ///< the object, or empty
  JobState state = JobState::running;
  std::string stage;  ///< what it is doing: "acquiring", "eigen-solve"
  std::size_t done = 0;
  std::size_t total = 0;
  std::string error;   ///< why it failed
  std::string hint;    ///< what to do then
  std::string result;  ///< a JSON object once it is done; empty before
  std::chrono::system_clock::time_point started;
  std::optional<std::chrono::system_clock::time_point> ended;
};

/// Runs jobs, each on a thread of its own, one of each kind at a time. Remembers the last hundred.
/// Thread-safe.
class Jobs {
 public:
  /// What a job is given.
  struct Context {
    Progress progress;
    std::stop_token stop;
    /// Told to the client beside the error's own hint if the job fails.
    std::function<void(std::string)> add_hint;
  };
  /// Does the work and returns its result as a JSON object in text. Failures leave as exceptions.
  using Work = std::function<std::string(const Context&)>;

  Jobs() = default;
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;
  /// Cancels what runs and waits for it.
  ~Jobs();

  /// @throws RequestError (409) when a job of that kind is running.
  JobStatus start(const std::string& kind, const std::string& subject, Work work);
  [[nodiscard]] std::optional<JobStatus> find(const std::string& id) const;
  [[nodiscard]] std::vector<JobStatus> list() const;  ///< oldest first
  [[nodiscard]] bool running(std::string_view kind) const;
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
  static void run(Job& job, const Work& work, const std::stop_token& stop);
  void forget_old();

  mutable std::mutex mutex_;
  std::map<std::uint64_t, std::shared_ptr<Job>> jobs_;  ///< guarded by mutex_
  std::uint64_t next_id_ = 1;                           ///< guarded by mutex_
};

}  // namespace eigenpose
