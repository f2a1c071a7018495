#include "sim/usb/apt_controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace eigenpose::sim {
namespace {

constexpr std::size_t apt_header = 6;
constexpr std::uint8_t address_here = 0x50;
constexpr std::uint8_t address_host = 0x01;
constexpr std::uint8_t long_flag = 0x80;
/// Status messages that go out without a sign of life from the host.
constexpr int patience_with_host = 50;

std::uint32_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value |= static_cast<std::uint32_t>(bytes[at + i]) << (8 * i);
  return value;
}

void append(std::vector<std::uint8_t>& bytes, std::uint32_t value, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

}  // namespace

AptController::AptController(SimLab& lab, AptControllerOptions options)
    : lab_(lab),
      options_(std::move(options)),
      speed_factor_(options_.speed_factor),
      motion_(Trajectory::standstill(
          (lab.axis_position_deg(options_.axis, lab.clock().now()) - options_.home_deg) *
              options_.counts_per_degree,
          lab.clock().now())) {}

std::vector<std::uint8_t> AptController::receive(std::span<const std::uint8_t> bytes) {
  const std::lock_guard lock(mutex_);
  finish_motion(lab_.clock().now());
  heard_.insert(heard_.end(), bytes.begin(), bytes.end());
  while (heard_.size() >= apt_header) {
    const bool is_long = (heard_[4] & long_flag) != 0;
    const std::size_t size = apt_header + (is_long ? little_endian(heard_, 2, 2) : 0);
    if ((heard_[4] & ~long_flag) != address_here || size > apt_header + 255) {
      heard_.clear();  // not for this unit, or the place in the stream is lost
      break;
    }
    if (heard_.size() < size) break;
    const std::vector<std::uint8_t> message(heard_.begin(),
                                            heard_.begin() + static_cast<std::ptrdiff_t>(size));
    heard_.erase(heard_.begin(), heard_.begin() + static_cast<std::ptrdiff_t>(size));
    obey(message);
  }
  return std::exchange(said_, {});
}

std::vector<std::uint8_t> AptController::spontaneous() {
  const std::lock_guard lock(mutex_);
  finish_motion(lab_.clock().now());
  return std::exchange(said_, {});
}

void AptController::set_faults(const AptFaults& faults) {
  const std::lock_guard lock(mutex_);
  const TimePoint now = lab_.clock().now();
  if (!faults.stuck && stuck_at_) {
    motion_ = Trajectory::standstill(*stuck_at_, now);
    stuck_at_.reset();
  } else if (faults.stuck && !stuck_at_) {
    stuck_at_ = counts_at(now);
    lab_.set_axis_motion(options_.axis,
                         Trajectory::standstill(lab_.axis_position_deg(options_.axis, now), now));
  }
  faults_ = faults;
}

void AptController::raise_fault(const std::string& words) {
  const std::lock_guard lock(mutex_);
  motion_error_ = true;
  std::vector<std::uint8_t> data;
  append(data, 0, 2);
  append(data, 1001, 2);
  std::string notes = words;
  notes.resize(64);
  data.insert(data.end(), notes.begin(), notes.end());
  say(0x0081, data);
}

int AptController::keep_alives() const {
  const std::lock_guard lock(mutex_);
  return keep_alives_;
}

void AptController::say(std::uint16_t number, std::uint8_t parameter1, std::uint8_t parameter2) {
  append(said_, number, 2);
  said_.push_back(parameter1);
  said_.push_back(parameter2);
  said_.push_back(address_host);
  said_.push_back(address_here);
}

void AptController::say(std::uint16_t number, std::span<const std::uint8_t> data) {
  append(said_, number, 2);
  append(said_, static_cast<std::uint32_t>(data.size()), 2);
  said_.push_back(address_host | long_flag);
  said_.push_back(address_here);
  said_.insert(said_.end(), data.begin(), data.end());
}

double AptController::counts_at(TimePoint now) const {
  return stuck_at_ ? *stuck_at_ : motion_.position(now) - slipped_;
}

std::uint32_t AptController::status_bits(TimePoint now) const {
  std::uint32_t bits = 0x00000100;  // motor connected
  if (enabled_) bits |= 0x80000000;
  if (motion_.moving(now)) bits |= motion_.velocity(now) >= 0.0 ? 0x10U : 0x20U;
  if (homing_) bits |= 0x00000200;
  if (homed_) bits |= 0x00000400;
  if (motion_error_) bits |= 0x00004000;
  return bits;
}

void AptController::say_status(std::uint16_t number) {
  const TimePoint now = lab_.clock().now();
  finish_motion(now);  // a motion that has ended by now has ended with all that comes with it
  if (updates_unanswered_ >= patience_with_host) return;
  ++updates_unanswered_;
  std::vector<std::uint8_t> data;
  append(data, 1, 2);
  append(data, static_cast<std::uint32_t>(std::llround(counts_at(now))), 4);
  append(data, 0, 4);  // velocity and current, or the encoder's count
  append(data, status_bits(now), 4);
  say(number, data);
}

void AptController::say_info() {
  std::vector<std::uint8_t> data;
  append(data, options_.serial_number, 4);
  std::string model = options_.model;
  model.resize(8);
  data.insert(data.end(), model.begin(), model.end());
  append(data, options_.stepper ? 16 : 44, 2);
  append(data, 0x00010203, 4);
  data.resize(data.size() + 60);
  append(data, 1, 2);
  append(data, 0, 2);
  append(data, 1, 2);
  say(0x0006, data);
}

void AptController::follow(const Trajectory& counts) {
  motion_ = counts;
  if (stuck_at_) return;
  lab_.set_axis_motion(
      options_.axis,
      counts.shifted(-slipped_).scaled(1.0 / options_.counts_per_degree).shifted(options_.home_deg));
}

void AptController::move_to_counts(double counts, double degrees_per_s, TimePoint now) {
  const double f = speed_factor_;
  const double scale = options_.counts_per_degree;
  const MotionLimits limits{degrees_per_s * scale * f, acceleration_ * scale * f * f,
                            acceleration_ * scale * f * f};
  if (!motion_.moving(now) && slipped_ != 0.0) motion_ = Trajectory::standstill(counts_at(now), now);
  slipped_ = 0.0;
  follow(motion_.move_to(counts, limits, now));
  tell_end_ = true;
  stopping_ = false;
}

void AptController::stop(Stop how, TimePoint now) {
  const double f = speed_factor_;
  follow(how == Stop::at_once ? motion_.freeze(now)
                              : motion_.stop(acceleration_ * options_.counts_per_degree * f * f, now));
  homing_ = false;
  tell_end_ = true;
  stopping_ = true;
}

void AptController::finish_motion(TimePoint now) {
  if (!tell_end_ || motion_.moving(now)) return;
  tell_end_ = false;
  if (stuck_at_) {
    motion_ = Trajectory::standstill(*stuck_at_, now);
    motion_error_ = true;
    homing_ = false;
    return;
  }
  if (faults_.slip_counts != 0.0 && !homing_) {
    slipped_ = std::exchange(faults_.slip_counts, 0.0);
    follow(Trajectory::standstill(motion_.position(now), now));
  }
  if (stopping_) {
    say_status(0x0466);
  } else if (homing_) {
    homing_ = false;
    homed_ = true;
    say(0x0444, 1, 0);
  } else {
    say_status(0x0464);
  }
}

void AptController::obey(std::span<const std::uint8_t> message) {
  const TimePoint now = lab_.clock().now();
  const std::uint32_t number = little_endian(message, 0, 2);
  const std::size_t data = apt_header;
  switch (number) {
    case 0x0005:
      say_info();
      break;
    case 0x0210:
      if (message[2] != 1) break;
      if (!enabled_ && message[3] == 1) motion_error_ = false;
      enabled_ = message[3] == 1;
      break;
    case 0x0413:
      if (message.size() != data + 14) break;
      acceleration_ = std::max(1.0, static_cast<double>(little_endian(message, data + 6, 4))) /
                      options_.acceleration_per_degree;
      velocity_ = std::max(1.0, static_cast<double>(little_endian(message, data + 10, 4))) /
                  options_.velocity_per_degree;
      break;
    case 0x0443:
      if (message[2] != 1 || !enabled_) break;
      motion_error_ = false;
      homed_ = false;
      homing_ = true;
      move_to_counts(0.0, options_.homing_speed, now);
      break;
    case 0x0453:
      if (message.size() != data + 6 || little_endian(message, data, 2) != 1 || !enabled_) break;
      motion_error_ = false;
      homing_ = false;
      move_to_counts(static_cast<std::int32_t>(little_endian(message, data + 2, 4)), velocity_, now);
      break;
    case 0x0465:
      if (message[2] == 1) stop(message[3] == 1 ? Stop::at_once : Stop::along_the_ramp, now);
      break;
    case 0x0480:
      if (options_.stepper) say_status(0x0481);
      break;
    case 0x0490:
      if (!options_.stepper) say_status(0x0491);
      break;
    case 0x0492:
      updates_unanswered_ = 0;
      ++keep_alives_;
      break;
    default:  // what it does not know it passes over
      break;
  }
}

}  // namespace eigenpose::sim
