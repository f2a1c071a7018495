#pragma once

/// Progress and stop requests of one stage of work that runs on several threads.

#include <cstddef>
#include <mutex>
#include <stop_token>
#include <string_view>

#include "core/base/progress.h"

namespace eigenpose {

/// Counts finished units and reports each to the listener, one call at a time and in ascending order, so that
/// a listener needs no lock. Thread-safe.
class WorkMeter {
 public:
  /// @param progress is kept by reference, and so is the text of `stage`.
  WorkMeter(const Progress& progress, std::stop_token stop, std::string_view stage, std::size_t total);

  /// Before a unit is begun. @throws Interrupted when a stop was requested.
  void check_stop() const;
  /// `units` more are finished. @throws Interrupted when a stop was requested.
  void finished(std::size_t units);

 private:
  const Progress& progress_;
  std::stop_token stop_;
  std::string_view stage_;
  std::size_t total_;
  std::mutex mutex_;
  std::size_t done_ = 0;  ///< guarded by mutex_, as are calls of progress_
};

}  // namespace eigenpose
