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
  std::size_t retaken = 0;       ///< pictures thrown away because an axis moved or a lamp was interrupted
  /// Why an axis does not stand where it stood before; the set is complete all the same.
  std::optional<std::string> not_returned;
};

/// What learning has gone on without, of one object.
struct LeftOutDetail {
  std::string object;
  bool whole_object = true;  ///< it is not in the model; else only some of its views are not
  std::size_t views = 0;     ///< that could not be used; 0 where none was looked at
  std::string reason;        ///< what is wrong with the object, or with the first of the views
};

/// What learning has made.
struct LearningResult {
  std::size_t objects = 0;
  std::size_t views = 0;
  std::size_t components = 0;
  double energy = 0.0;  ///< share of the views' energy that the components keep, 0…1
  std::chrono::duration<double> time{};
  std::filesystem::path file;  ///< of the model
  /// Objects that are not in the model, though they have an image set or stood in the former model; none that
  /// was not asked for where objects were named. Ordered by name.
  std::vector<std::string> left_out = {};
  /// Why, and which objects were learned without some of their views.
  std::vector<LeftOutDetail> left_out_details = {};
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
