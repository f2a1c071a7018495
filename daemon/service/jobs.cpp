#include "daemon/service/jobs.h"

#include <charconv>
#include <system_error>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

constexpr std::size_t remembered_jobs = 100;

std::uint64_t number_of(const std::string& id) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(id.data(), id.data() + id.size(), number);
  return error == std::errc() && end == id.data() + id.size() ? number : 0;
}

}  // namespace

std::string_view job_kind_name(JobKind kind) {
  return kind == JobKind::acquire ? "acquire" : "learn";
}

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

Jobs::Jobs(EventSink& events, Heartbeat& heartbeat)
    : Jobs(events, heartbeat,
           [](std::function<void(const std::stop_token&)> body) { return std::jthread(std::move(body)); }) {}

Jobs::Jobs(EventSink& events, Heartbeat& heartbeat, StartThread start_thread)
    : events_(events), heartbeat_(heartbeat), start_thread_(std::move(start_thread)) {}

Jobs::~Jobs() {
  const std::lock_guard lock(mutex_);
  for (const auto& [id, job] : jobs_) job->thread.request_stop();
  jobs_.clear();  // joins
}

JobStatus Jobs::start(JobKind kind, const std::string& subject, Work work) {
  const std::lock_guard lock(mutex_);
  for (const auto& [id, job] : jobs_) {
    const std::lock_guard job_lock(job->mutex);
    if (job->status.kind == kind && job->status.state == JobState::running)
      throw ServiceError(Fault::busy,
                         fmt::format("job {} ({}) is running", job->status.id, job_kind_name(kind)),
                         "wait for it, or cancel job " + job->status.id);
  }
  forget_old();
  const auto job = std::make_shared<Job>();
  const std::uint64_t id = next_id_++;
  job->status.id = std::to_string(id);
  job->status.kind = kind;
  job->status.subject = subject;
  job->status.started = std::chrono::system_clock::now();
  JobStatus first = job->status;
  jobs_[id] = job;
  try {
    job->thread = start_thread_([this, raw = job.get(), work = std::move(work)](const std::stop_token& stop) {
      run(*raw, work, stop);
    });
  } catch (const std::system_error& error) {
    end(*job, JobState::failed, {},
        Failure{Fault::unavailable, std::string("no thread could be started for the job: ") + error.what(),
                "end other programs or raise the limit of processes, then start it again"});
    const std::lock_guard job_lock(job->mutex);
    first = job->status;
  }
  return first;
}

void Jobs::run(Job& job, const Work& work, const std::stop_token& stop) {
  JobStatus started;
  {
    const std::lock_guard lock(job.mutex);
    started = job.status;
  }
  // An acquisition is the rig's work, and the rig beats itself.
  Heartbeat::Pulse pulse;
  if (started.kind == JobKind::learn) pulse = heartbeat_.join("job " + started.id, job_step_limit);
  events_.publish(JobChanged{std::move(started)});
  Context context;
  context.stop = stop;
  std::mutex pulse_mutex;  // progress comes from several threads
  context.progress = [&](const ProgressUpdate& update) {
    {
      const std::lock_guard lock(pulse_mutex);
      pulse.beat();
    }
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
  std::optional<Failure> failure;
  JobResult result;
  try {
    result = work(context);
  } catch (const Interrupted&) {
    state = JobState::cancelled;
    failure = failure_of(std::current_exception());
  } catch (...) {
    // A device that was stopped on request may fail in its own words.
    state = stop.stop_requested() ? JobState::cancelled : JobState::failed;
    failure = failure_of(std::current_exception());
  }
  end(job, state, std::move(result), std::move(failure));
}

void Jobs::end(Job& job, JobState state, JobResult result, std::optional<Failure> failure) {
  JobStatus status;
  {
    const std::lock_guard lock(job.mutex);
    if (failure && !job.extra_hint.empty())
      failure->hint += (failure->hint.empty() ? "" : ". ") + job.extra_hint;
    job.status.failure = std::move(failure);
    job.status.result = std::move(result);
    job.status.ended = std::chrono::system_clock::now();
    job.status.state = state;
    status = job.status;
  }
  if (state == JobState::failed)
    spdlog::error("event=job_failed job={} kind={} subject={} error=\"{}\"", status.id,
                  job_kind_name(status.kind), status.subject, status.failure->what);
  else
    spdlog::info("event=job_{} job={} kind={} subject={}", job_state_name(state), status.id,
                 job_kind_name(status.kind), status.subject);
  events_.publish(JobChanged{std::move(status)});
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

std::optional<JobStatus> Jobs::running(JobKind kind) const {
  for (JobStatus& job : list())
    if (job.kind == kind && job.state == JobState::running) return std::move(job);
  return std::nullopt;
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
