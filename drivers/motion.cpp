#include "drivers/motion.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "drivers/axis.h"

namespace eigenpose {

MotionGate::Passage::Passage(MotionGate& gate, const std::stop_token& caller)
    : gate_(gate), on_caller_(caller, [this] { source_.request_stop(); }) {
  const std::lock_guard lock(gate_.mutex_);
  gate_.current_ = &source_;
}

MotionGate::Passage::~Passage() {
  const std::lock_guard lock(gate_.mutex_);
  gate_.current_ = nullptr;
}

void MotionGate::interrupt() {
  const std::lock_guard lock(mutex_);
  if (current_ != nullptr) current_->request_stop();
}

MotionWatch::MotionWatch(std::string device, std::string operation, Dof dof, Goal goal, double target,
                         double tolerance, MotionPatience patience, TimePoint now)
    : device_(std::move(device)),
      operation_(std::move(operation)),
      dof_(std::move(dof)),
      goal_(goal),
      target_(target),
      tolerance_(tolerance),
      patience_(patience),
      start_(now),
      last_change_(now),
      still_since_(now) {}

std::string MotionWatch::in_words(double position) const {
  return fmt::format("{:.3f} {}", dof_.canonical(position), dof_.unit);
}

void MotionWatch::fail(const std::string& cause) const {
  throw DeviceError(device_, operation_, cause);
}

bool MotionWatch::arrived(const MotionReading& reading, TimePoint now, TimePoint deadline) {
  if (reading.alarm) fail("alarm: " + *reading.alarm);
  if (!last_position_ || *last_position_ != reading.position) last_change_ = now;
  last_position_ = reading.position;

  if (reading.moving) {
    moving_ = moved_at_all_ = true;
    if (now - last_change_ >= patience_.stall_time)
      fail("the motor is stuck at " + in_words(reading.position));
  } else {
    if (moving_) still_since_ = now;
    moving_ = false;
    // Homing may end where it began; a drive that has not begun yet is told from that by the start time only.
    const bool there = goal_ == Goal::target
                           ? std::abs(reading.position - target_) <= tolerance_
                           : reading.homed && (moved_at_all_ || now - start_ >= patience_.start_time);
    if (there && reading.in_position) return true;
    if (now - still_since_ >= (moved_at_all_ ? patience_.settle_time : patience_.start_time)) {
      if (goal_ == Goal::home) fail("the drive stands still and is not homed");
      fail(fmt::format("{} at {}, not at {}: blocked, or steps were lost",
                       moved_at_all_ ? "it stopped" : "it did not move and stands",
                       in_words(reading.position), in_words(target_)));
    }
  }
  if (now >= deadline)
    throw DeviceTimeout(device_, operation_,
                        "not there by the deadline; it is at " + in_words(reading.position));
  return false;
}

double nearest_target(const Dof& dof, double position, double from) {
  return dof.periodic ? from + dof.difference(position, from) : position;
}

void check_target(const std::string& device, const Dof& dof, double position) {
  if (!(position >= dof.lower && position <= dof.upper))
    throw std::out_of_range(
        fmt::format("{}: {} {} is outside {} … {}", device, position, dof.unit, dof.lower, dof.upper));
}

void check_jog(const std::string& device, const Dof& dof, double distance, bool homed) {
  const double range = dof.upper - dof.lower;
  if (!(std::abs(distance) <= range))
    throw std::out_of_range(fmt::format("{}: a jog by {} {} is longer than the range of {} {}", device,
                                        distance, dof.unit, range, dof.unit));
  const double longest = longest_unhomed_jog(dof);
  if (!homed && std::abs(distance) > longest)
    throw std::out_of_range(fmt::format(
        "{}: not homed, so its limits are not known: {:g} {} at most in one go; home it first, or jog less",
        device, longest, dof.unit));
}

}  // namespace eigenpose
