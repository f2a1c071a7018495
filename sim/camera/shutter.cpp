#include "sim/camera/shutter.h"

#include <algorithm>
#include <stdexcept>

#include "core/base/error.h"
#include "sim/lab/chance.h"

namespace eigenpose::sim {
namespace {

constexpr std::uint64_t damage_stream = 7001;

Duration period_of(double frames_per_second) {
  if (!(frames_per_second > 0.0 && frames_per_second <= 1000.0)) {
    throw std::invalid_argument(
        "a simulated camera takes more than 0 and at most 1000 frames per second, not " +
        std::to_string(frames_per_second));
  }
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1.0 / frames_per_second));
}

}  // namespace

Shutter::Shutter(const SimLab& lab, std::string name, double frames_per_second, Duration exposure)
    : lab_(lab),
      name_(std::move(name)),
      period_(period_of(frames_per_second)),
      exposure_(exposure),
      begin_(lab.clock().now()) {
  if (exposure <= Duration::zero() || exposure > period_) {
    throw std::invalid_argument(
        "a simulated camera's exposure must be longer than 0 and at most the time between "
        "two frames, " +
        std::to_string(std::chrono::duration<double, std::milli>(period_).count()) + " ms");
  }
}

CameraStatistics Shutter::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

bool Shutter::damaged(std::int64_t index, const CameraFaults& faults) const {
  if (lab_.frame_damaged(start_of(index))) return true;
  if (faults.damaged_fraction <= 0.0) return false;
  Chance chance(lab_.seed() + static_cast<std::uint64_t>(index), damage_stream);
  return chance.uniform() < faults.damaged_fraction;
}

void Shutter::sleep(TimePoint when, const std::stop_token& stop) const {
  if (!lab_.clock().sleep_until(when, stop)) throw Interrupted();
}

void Shutter::wait_until_present(TimePoint deadline, const std::stop_token& stop) {
  while (lab_.camera_faults().lost) {
    if (!lost_) {
      lost_ = true;
      const std::lock_guard lock(mutex_);
      ++statistics_.times_lost;
      throw DeviceLost(name_, "next frame", "the camera is gone; plug it in again");
    }
    const TimePoint now = lab_.clock().now();
    if (now >= deadline) throw DeviceLost(name_, "reopen", "the camera is still gone; plug it in again");
    sleep(std::min(deadline, now + period_), stop);
  }
  if (lost_) {
    lost_ = false;
    // What it would have taken while it was gone was never taken.
    seen_ = std::max(seen_, (lab_.clock().now() - begin_) / period_ - 1);
  }
}

Exposure Shutter::next(TimePoint deadline, const std::stop_token& stop) {
  for (;;) {
    if (stop.stop_requested()) throw Interrupted();
    wait_until_present(deadline, stop);
    const CameraFaults faults = lab_.camera_faults();
    const TimePoint now = lab_.clock().now();
    const std::int64_t done = now < begin_ + exposure_ ? -1 : (now - begin_ - exposure_) / period_;
    if (faults.stalled) {
      seen_ = std::max(seen_, done);
      if (now >= deadline) throw DeviceTimeout(name_, "next frame", "no frame came; the camera has stalled");
      sleep(std::min(deadline, now + period_), stop);
      continue;
    }
    std::int64_t newest = -1;
    for (std::int64_t index = done; index > seen_; --index) {
      const bool bad = damaged(index, faults);
      if (!bad && newest < 0) {
        newest = index;
        continue;
      }
      const std::lock_guard lock(mutex_);
      ++(bad ? statistics_.frames_damaged : statistics_.frames_dropped);
    }
    seen_ = std::max(seen_, done);
    if (newest >= 0) {
      const std::lock_guard lock(mutex_);
      ++statistics_.frames_taken;
      return {static_cast<std::uint64_t>(newest), start_of(newest), start_of(newest) + exposure_};
    }
    if (now >= deadline) throw DeviceTimeout(name_, "next frame", "no frame came before the deadline");
    sleep(std::min(deadline, start_of(seen_ + 1) + exposure_), stop);
  }
}

}  // namespace eigenpose::sim
