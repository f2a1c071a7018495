#include "daemon/service/jobs.h"

#include <charconv>

#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "daemon/api/errors.h"

namespace eigenpose {
namespace {

constexpr std::size_t remembered_jobs = 100;

std::uint64_t number_of(const std::string& id) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(id.data(), id.data() + id.size(), number);
  return error == std::errc() && end == id.data() + id.size() ? number : 0;
}

}  // namespace

std::string_view job_state_name(JobState state) {
  switch (state) {
    case JobState::running:
      return "running";
    case JobState::done:
      return "done";
    case JobState::failed:
      return "failed";
    case JobState::cancelled:
      return "cancelled";
  }
  return "failed";
}

Jobs::~Jobs() {
  const std::lock_guard lock(mutex_);
  for (const auto& [id, job] : jobs_) job->thread.request_stop();
  jobs_.clear();  // joins
}

JobStatus Jobs::start(const std::string& kind, const std::string& subject, Work work) {
  const std::lock_guard lock(mutex_);
  for (const auto& [id, job] : jobs_) {
    const std::lock_guard job_lock(job->mutex);
    if (job->status.kind == kind && job->status.state == JobState::running)
      throw RequestError(409, "job " + job->status.id + " (" + kind + ") is running",
                         "wait for it, or cancel it: DELETE /v1/jobs/" + job->status.id);
  }
  forget_old();
  const auto job = std::make_shared<Job>();
  const std::uint64_t id = next_id_++;
  job->status.id = std::to_string(id);
  job->status.kind = kind;
  job->status.subject = subject;
  job->status.started = std::chrono::system_clock::now();
  const JobStatus first = job->status;
  jobs_[id] = job;
  job->thread = std::jthread(
      [raw = job.get(), work = std::move(work)](const std::stop_token& stop) { run(*raw, work, stop); });
  return first;
}

void Jobs::run(Job& job, const Work& work, const std::stop_token& stop) {
  Context context;
  context.stop = stop;
  context.progress = [&job](const ProgressUpdate& update) {
    const std::lock_guard lock(job.mutex);
    job.status.stage = update.stage;
    job.status.done = update.done;
    job.status.total = update.total;
  };
  context.add_hint = [&job](std::string hint) {
    const std::lock_guard lock(job.mutex);
    job.extra_hint = std::move(hint);
  };
  JobState state = JobState::done;
  Trouble trouble;
  std::string result;
  try {
    result = work(context);
  } catch (const Interrupted& interrupted) {
    state = JobState::cancelled;
    trouble = describe(std::current_exception());
  } catch (...) {
    // A device that was stopped on request may complain in its own words.
    state = stop.stop_requested() ? JobState::cancelled : JobState::failed;
    trouble = describe(std::current_exception());
  }
  const std::lock_guard lock(job.mutex);
  JobStatus& status = job.status;
  status.error = trouble.error;
  status.hint = trouble.hint;
  if (state != JobState::done && !job.extra_hint.empty())
    status.hint += (status.hint.empty() ? "" : ". ") + job.extra_hint;
  status.result = std::move(result);
  status.ended = std::chrono::system_clock::now();
  status.state = state;
  if (state == JobState::failed)
    spdlog::error("event=job_failed job={} kind={} subject={} error=\"{}\"", status.id, status.kind,
                  status.subject, status.error);
  else
    spdlog::info("event=job_{} job={} kind={} subject={}", job_state_name(state), status.id, status.kind,
                 status.subject);
}

std::optional<JobStatus> Jobs::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = jobs_.find(number_of(id));
  if (found == jobs_.end()) return std::nullopt;
  const std::lock_guard job_lock(found->second->mutex);
  return found->second->status;
}

std::vector<JobStatus> Jobs::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<JobStatus> result;
  for (const auto& [id, job] : jobs_) {
    const std::lock_guard job_lock(job->mutex);
    result.push_back(job->status);
  }
  return result;
}

bool Jobs::running(std::string_view kind) const {
  for (const JobStatus& job : list())
    if (job.kind == kind && job.state == JobState::running) return true;
  return false;
}

std::optional<JobStatus> Jobs::cancel(const std::string& id) {
  std::shared_ptr<Job> job;
  {
    const std::lock_guard lock(mutex_);
    const auto found = jobs_.find(number_of(id));
    if (found == jobs_.end()) return std::nullopt;
    job = found->second;
    // Stop callbacks talk to devices: not under a lock that others wait for.
  }
  job->thread.request_stop();
  const std::lock_guard lock(job->mutex);
  return job->status;
}

void Jobs::forget_old() {
  for (auto it = jobs_.begin(); jobs_.size() >= remembered_jobs && it != jobs_.end();) {
    bool ended = false;
    {
      const std::lock_guard lock(it->second->mutex);
      ended = it->second->status.state != JobState::running;
    }
    it = ended ? jobs_.erase(it) : std::next(it);
  }
}

}  // namespace eigenpose
