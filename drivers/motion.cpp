#include "drivers/motion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

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

void MovementTracker::add(double position, TimePoint now) {
  // Two counts, the smallest tolerance of a driver, may be read as a little more after the arithmetic.
  constexpr double beyond_rounding = 1.25;
  if (!stretch_ || std::abs(position - stretch_->newest) > beyond_rounding * tolerance_)
    stretch_ = {position, position, position};
  else if (position < stretch_->low || position > stretch_->high)
    stretch_ = {std::min(position, stretch_->low), std::max(position, stretch_->high), position};
  else
    return;
  last_movement_ = now;
}

MotionWatch::MotionWatch(MotionOrder order, TimePoint now)
    : order_(std::move(order)), start_(now), movement_(order_.tolerance, now), still_since_(now) {}

std::string MotionWatch::in_words(double position) const {
  return fmt::format("{:.3f} {}", order_.dof.canonical(position), order_.dof.unit);
}

void MotionWatch::fail(const std::string& cause) const {
  throw DeviceError(order_.device, order_.operation, cause);
}

bool MotionWatch::stands_at_goal(const MotionReading& reading, TimePoint now) const {
  if (!reading.in_position) return false;
  if (order_.goal == MotionOrder::Goal::target)
    return std::abs(reading.position - order_.target) <= order_.tolerance;
  // Homing may end where it began; only the start time tells that from a drive that has not begun yet.
  return reading.homed && (moved_at_all_ || now - start_ >= order_.patience.start_time);
}

bool MotionWatch::arrived(const MotionReading& reading, TimePoint now, TimePoint deadline) {
  if (reading.alarm) fail("alarm: " + *reading.alarm);
  movement_.add(reading.position, now);

  if (reading.moving) {
    moving_ = moved_at_all_ = true;
    if (now - movement_.last_movement() >= order_.patience.stall_time)
      fail("the motor is stuck at " + in_words(reading.position));
  } else {
    if (moving_) still_since_ = now;
    moving_ = false;
    if (stands_at_goal(reading, now)) return true;
    const Duration patience = moved_at_all_ ? order_.patience.settle_time : order_.patience.start_time;
    if (now - still_since_ >= patience) {
      if (order_.goal == MotionOrder::Goal::home) fail("the drive stands still and is not homed");
      fail(fmt::format("{} at {}, not at {}: blocked, or steps were lost",
                       moved_at_all_ ? "it stopped" : "it did not move and stands",
                       in_words(reading.position), in_words(order_.target)));
    }
  }
  if (now >= deadline)
    throw DeviceTimeout(order_.device, order_.operation,
                        "not there by the deadline; it is at " + in_words(reading.position));
  return false;
}

namespace {

/// The same failure with what became of the motor behind its cause.
template <class Failure>
[[noreturn]] void rethrow_with(const Failure& failure, const std::string& consequence) {
  const std::string cause =
      std::string(failure.what()).substr(failure.device().size() + failure.operation().size() + 4);
  throw Failure(failure.device(), failure.operation(), cause + "; " + consequence);
}

}  // namespace

void heed(const std::stop_token& stop, const std::string& device, const std::string& operation) {
  if (stop.stop_requested()) throw Interrupted(device + ": " + operation + ": interrupted on request");
}

MotionReading carry_out(const MotionOrder& order, const MotionSteps& steps, const Clock& clock,
                        TimePoint deadline, const std::stop_token& stop) {
  try {
    MotionWatch watch(order, clock.now());
    heed(stop, order.device, order.operation);
    steps.start();
    for (;;) {
      heed(stop, order.device, order.operation);
      MotionReading reading = steps.read();
      const TimePoint now = clock.now();
      if (watch.arrived(reading, now, deadline)) {
        steps.finish();
        return reading;
      }
      clock.sleep_until(std::min(deadline, now + order.patience.poll_interval), stop);
    }
  } catch (const Interrupted& interrupted) {
    throw Interrupted(std::string(interrupted.what()) + "; " + steps.halt());
  } catch (const DeviceTimeout& failure) {
    rethrow_with(failure, steps.halt());
  } catch (const DeviceLost& failure) {
    rethrow_with(failure, steps.halt());
  } catch (const DeviceError& failure) {
    const std::string consequence = steps.halt();
    if (stop.stop_requested())
      throw Interrupted(failure.device() + ": " + failure.operation() + ": interrupted on request; " +
                        consequence);
    rethrow_with(failure, consequence);
  } catch (const std::exception& failure) {
    // No memory, no thread, no folder for a claim: the motor is told to stop all the same.
    const std::string cause = failure.what();
    throw DeviceError(order.device, order.operation, cause + "; " + steps.halt());
  } catch (...) {
    steps.halt();
    throw;
  }
}

double nearest_target(const Dof& dof, double position, double from) {
  return dof.periodic ? from + dof.difference(position, from) : position;
}

void check_jog(const std::string& device, const Dof& dof, double distance) {
  const double range = dof.upper - dof.lower;
  if (!(std::abs(distance) <= range))
    throw std::out_of_range(fmt::format("{}: a jog by {} {} is longer than the range of {} {}", device,
                                        distance, dof.unit, range, dof.unit));
}

void check_unhomed_jog(const std::string& device, const Dof& dof, double distance) {
  const double longest = longest_unhomed_jog(dof);
  if (!(std::abs(distance) <= longest))
    throw std::out_of_range(fmt::format(
        "{}: not homed, so its limits are not known: {:g} {} at most in one go; home it first, or jog less",
        device, longest, dof.unit));
}

}  // namespace eigenpose
