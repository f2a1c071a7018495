#include "core/base/work_meter.h"

#include <string>
#include <utility>

#include "core/base/error.h"

namespace eigenpose {

WorkMeter::WorkMeter(const Progress& progress, std::stop_token stop, std::string_view stage,
                     std::size_t total)
    : progress_(progress), stop_(std::move(stop)), stage_(stage), total_(total) {}

void WorkMeter::check_stop() const {
  if (stop_.stop_requested()) throw Interrupted("interrupted while " + std::string(stage_));
}

void WorkMeter::finished(std::size_t units) {
  check_stop();
  const std::lock_guard lock(mutex_);
  done_ += units;
  if (progress_) progress_({stage_, done_, total_});
}

}  // namespace eigenpose
