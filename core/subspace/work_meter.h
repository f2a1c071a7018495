#pragma once

/// Progress and stop requests of work that runs on several threads.

#include <cstddef>
#include <mutex>
#include <stop_token>
#include <string_view>

#include "core/base/progress.h"

namespace eigenpose {

/// Counts finished units and tells the listener, one call at a time. Thread-safe.
class WorkMeter {
 public:
  WorkMeter(const Progress& progress, std::stop_token stop, std::string_view stage, std::size_t total);
  /// `units` more are finished. @throws Interrupted when a stop was requested.
  void finished(std::size_t units);

 private:
  const Progress& progress_;
  std::stop_token stop_;
  std::string_view stage_;
  std::size_t total_;
  std::mutex mutex_;
  std::size_t done_ = 0;  ///< guarded by mutex_
};

}  // namespace eigenpose
