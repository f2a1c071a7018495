#pragma once

/// What is known of a job: plain values.

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "daemon/service/errors.h"

namespace eigenpose {

enum class JobKind { acquire, learn };
/// "acquire", "learn": stable names.
std::string_view job_kind_name(JobKind kind);

enum class JobState { running, done, failed, cancelled };
/// "running", "done", "failed", "cancelled": stable names.
std::string_view job_state_name(JobState state);

/// What an acquisition has made.
struct AcquisitionResult {
  std::filesystem::path folder;  ///< of the image set
  std::size_t views = 0;         ///< of the plan
  std::size_t kept = 0;          ///< of these, taken by an earlier, interrupted run
  std::size_t retaken = 0;       ///< pictures thrown away because an axis moved meanwhile
  /// Why an axis does not stand where it stood before; the set is complete all the same.
  std::optional<std::string> not_returned;
};

/// What learning has made.
struct LearningResult {
  std::size_t objects = 0;
  std::size_t views = 0;
  std::size_t components = 0;
  double energy = 0.0;  ///< share of the views' energy that the components keep, 0…1
  std::chrono::duration<double> time{};
  std::filesystem::path file;         ///< of the model
  std::vector<std::string> left_out;  ///< image sets that are incomplete or cannot be read
};

/// Nothing until the job is done.
using JobResult = std::variant<std::monostate, AcquisitionResult, LearningResult>;

/// A job as it stands at one moment.
struct JobStatus {
  std::string id;  ///< "1", "2", …
  JobKind kind = JobKind::acquire;
  std::string subject;  ///< the object, or empty
  JobState state = JobState::running;
  std::string stage;  ///< what it is doing: "acquiring", "eigen-solve"
  std::size_t done = 0;
  std::size_t total = 0;
  std::optional<Failure> failure;  ///< why it failed, or that it was cancelled
  JobResult result;
  std::chrono::system_clock::time_point started;
  std::optional<std::chrono::system_clock::time_point> ended;
};

}  // namespace eigenpose
