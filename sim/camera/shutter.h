#pragma once

/// When a simulated camera takes pictures, which of them are handed out, and what happens when it fails.

#include <cstdint>
#include <mutex>
#include <stop_token>
#include <string>

#include "core/base/clock.h"
#include "drivers/camera.h"
#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

/// A picture that has been taken.
struct Exposure {
  std::uint64_t sequence = 0;
  TimePoint start;
  TimePoint end;
};

/// The camera runs freely at its rate from its construction. Lives on one thread, except `statistics`.
class Shutter {
 public:
  /// @throws std::invalid_argument when the exposure is longer than the time between two pictures.
  Shutter(const SimLab& lab, std::string name, double frames_per_second, Duration exposure);

  /// The newest picture not handed out yet, as Camera::next_frame says; obeys the lab's camera faults.
  Exposure next(TimePoint deadline, const std::stop_token& stop);
  [[nodiscard]] CameraStatistics statistics() const;

 private:
  void wait_until_present(TimePoint deadline, const std::stop_token& stop);
  [[nodiscard]] TimePoint start_of(std::int64_t index) const { return begin_ + index * period_; }
  [[nodiscard]] bool damaged(std::int64_t index, const CameraFaults& faults) const;
  void sleep(TimePoint when, const std::stop_token& stop) const;

  const SimLab& lab_;
  const std::string name_;
  const Duration period_;
  const Duration exposure_;
  const TimePoint begin_;
  std::int64_t seen_ = -1;  ///< newest index handed out, dropped or damaged
  bool lost_ = false;
  mutable std::mutex mutex_;
  CameraStatistics statistics_;  ///< guarded by mutex_
};

}  // namespace eigenpose::sim
