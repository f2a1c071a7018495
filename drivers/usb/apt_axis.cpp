#include "drivers/usb/apt_axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;
using apt::Message;
using apt::StatusBits;

constexpr Duration stop_patience =
    3s;  ///< for telling the controller to stop, whatever the caller's deadline
constexpr Duration standstill_patience = 5s;  ///< for a motor that is told to stop to stand
constexpr Duration quiet = 50ms;              ///< silence after which no part of an old message can follow
constexpr double default_tolerance_counts = 20.0;
constexpr std::uint8_t stop_along_the_ramp = 2;
constexpr std::uint8_t channel_on = 1;
constexpr std::uint8_t channel_off = 2;

void check(const AptAxisOptions& options) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("axis " + options.name + ": " + what);
  };
  if (options.name.empty()) throw std::invalid_argument("an APT axis needs a name");
  if (!(options.dof.lower < options.dof.upper))
    refuse(fmt::format("range {} … {} is empty", options.dof.lower, options.dof.upper));
  if (!(options.stage.counts_per_unit > 0)) refuse("the stage has no counts per unit");
  if (options.stage.unit != options.dof.unit)
    refuse(fmt::format("the stage {} moves in {}, the axis in {}", options.stage.name, options.stage.unit,
                       options.dof.unit));
  if (options.channel < 1) refuse("channels count from 1");
  if (!(options.speed >= 0) || !(options.acceleration >= 0) || !(options.arrival_tolerance >= 0))
    refuse("speed, acceleration and tolerance must not be negative");
  if (options.attempts < 1 || options.attempts > 10)
    refuse(fmt::format("attempts must be 1 … 10, got {}", options.attempts));
}

std::int32_t controller_number(double value) {
  return static_cast<std::int32_t>(std::clamp(std::round(value), 1.0, 2147483647.0));
}

}  // namespace

AptAxis::AptAxis(AptAxisOptions options, std::unique_ptr<ByteLink> link, const Clock& clock)
    : options_(std::move(options)), clock_(clock), link_(std::move(link)), unpacker_(options_.controller) {
  check(options_);
  if (!link_) throw std::invalid_argument("axis " + options_.name + ": no link");
  if (options_.speed == 0.0) options_.speed = options_.stage.speed;
  if (options_.acceleration == 0.0) options_.acceleration = options_.stage.acceleration;
  info_.dof = options_.dof;
  info_.model = "Thorlabs APT " + options_.stage.name;
  info_.resolution = 1.0 / options_.stage.counts_per_unit;
  info_.arrival_tolerance = options_.arrival_tolerance > 0 ? options_.arrival_tolerance
                                                           : default_tolerance_counts * info_.resolution;
}

AptAxis::~AptAxis() {
  if (!may_be_moving_) return;
  try {
    send_stop(clock_.now() + stop_patience);
  } catch (const std::exception&) {
    // Nobody is left to report to.
  }
}

double AptAxis::position_of(std::int32_t counts) const {
  const double counted = counts / options_.stage.counts_per_unit;
  return (options_.reversed ? -counted : counted) - options_.zero_offset;
}

std::int32_t AptAxis::counts_of(const std::string& operation, double position) const {
  const double from_home = position + options_.zero_offset;
  const double counts =
      std::round((options_.reversed ? -from_home : from_home) * options_.stage.counts_per_unit);
  if (std::abs(counts) > std::numeric_limits<std::int32_t>::max())
    throw DeviceError(options_.name, operation,
                      fmt::format("{} counts are more than the controller can count; home the axis", counts));
  return static_cast<std::int32_t>(counts);
}

template <class Work, class First>
auto AptAxis::with_retries(const std::string& operation, TimePoint deadline, const Work& work,
                           const First& first) {
  if (clock_.now() >= deadline)
    throw DeviceTimeout(options_.name, operation, "no time left before the deadline");
  for (int attempt = 1;; ++attempt) {
    try {
      if (link_suspect_) {
        link_->reopen(std::min(deadline, clock_.now() + options_.response_timeout));
        drain(deadline);
        link_suspect_ = false;
        is_set_up_ = false;
      }
      first();
      if (!is_set_up_) set_up(operation, deadline);
      return work();
    } catch (const DeviceError& failure) {
      link_suspect_ = true;
      const bool last = attempt >= options_.attempts || clock_.now() >= deadline;
      if (!last) continue;
      const std::string tries = attempt > 1 ? fmt::format("tried {} times", attempt) : "tried once";
      const auto* lost = dynamic_cast<const DeviceLost*>(&failure);
      const auto* late = dynamic_cast<const DeviceTimeout*>(&failure);
      const std::string where = fmt::format("{} ({})", link_->description(), tries);
      if (lost != nullptr)
        throw DeviceLost(options_.name, operation, fmt::format("{}: {}", where, failure.what()));
      if (late != nullptr) throw DeviceTimeout(options_.name, operation, fmt::format("{}: no answer", where));
      throw DeviceError(options_.name, operation, fmt::format("{}: {}", where, failure.what()));
    }
  }
}

void AptAxis::drain(TimePoint deadline) {
  unpacker_.clear();
  std::array<std::uint8_t, 256> rubbish{};
  const TimePoint patience = std::min(deadline, clock_.now() + options_.response_timeout);
  while (clock_.now() < patience && link_->read(rubbish, std::min(patience, clock_.now() + quiet)) > 0) {
  }
}

void AptAxis::transmit(std::span<const std::uint8_t> message, TimePoint deadline) {
  link_->write(message, std::min(deadline, clock_.now() + options_.response_timeout));
}

apt::Received AptAxis::wait_for(Message number, const std::string& operation, TimePoint deadline) {
  const TimePoint patience = std::min(deadline, clock_.now() + options_.response_timeout);
  std::array<std::uint8_t, 256> buffer{};
  std::optional<apt::Received> answer;
  for (;;) {
    try {
      while (auto message = unpacker_.next()) {
        if (auto words = apt::fault_of(*message)) fault_ = std::move(words);
        if (message->number == static_cast<std::uint16_t>(number)) answer = std::move(message);
      }
    } catch (const std::runtime_error& error) {
      throw DeviceError(options_.name, operation, error.what());
    }
    // Messages have no checksum. If bytes of one were lost, those of the next fill its place, and what is
    // left over is no message: so an answer counts only when the stream stands between two messages.
    if (answer && unpacker_.between_messages()) return std::move(*answer);
    // Bytes that keep coming are no answer either.
    const std::size_t count = clock_.now() < patience ? link_->read(buffer, patience) : 0;
    if (count == 0) throw DeviceTimeout(options_.name, operation, "no answer");
    unpacker_.feed(std::span(buffer).first(count));
  }
}

void AptAxis::set_up(const std::string& operation, TimePoint deadline) {
  unpacker_.clear();
  link_->discard_input();
  // Status is asked for; updates nobody asked for would only fill the line.
  transmit(apt::short_message(Message::hw_stop_updates, 0, 0, options_.controller), deadline);
  transmit(apt::short_message(Message::hw_request_info, 0, 0, options_.controller), deadline);
  (void)wait_for(Message::hw_info, operation, deadline);
  transmit(
      apt::short_message(Message::set_channel_enabled, options_.channel, channel_on, options_.controller),
      deadline);
  transmit(apt::set_velocity(options_.channel,
                             controller_number(options_.acceleration * options_.stage.acceleration_per_unit),
                             controller_number(options_.speed * options_.stage.velocity_per_unit),
                             options_.controller),
           deadline);
  is_set_up_ = true;
}

apt::Status AptAxis::ask_status(const std::string& operation, TimePoint deadline) {
  const bool stepper = options_.stage.stepper;
  // The controller stops answering after 50 updates when the host never says that it is alive.
  transmit(apt::short_message(Message::acknowledge_dc_status, 0, 0, options_.controller), deadline);
  transmit(apt::short_message(stepper ? Message::request_stepper_status : Message::request_dc_status,
                              options_.channel, 0, options_.controller),
           deadline);
  const apt::Received answer =
      wait_for(stepper ? Message::stepper_status : Message::dc_status, operation, deadline);
  const auto status = apt::status_of(answer);
  if (!status) throw DeviceError(options_.name, operation, "status of a wrong length");
  if (status->channel != options_.channel)
    throw DeviceError(options_.name, operation, fmt::format("status of channel {}", status->channel));
  return *status;
}

MotionReading AptAxis::read(const std::string& operation, TimePoint deadline) {
  const std::lock_guard lock(link_mutex_);
  const apt::Status status =
      with_retries(operation, deadline, [&] { return ask_status(operation, deadline); });
  MotionReading reading;
  reading.moving = (status.bits & (StatusBits::moving | StatusBits::homing)) != 0;
  reading.homed = (status.bits & StatusBits::homed) != 0;
  // What the controller said in words goes before what its bits say.
  if ((status.bits & StatusBits::motion_error) != 0 && !fault_)
    fault_ = "the motor lags behind: blocked or overloaded";
  if ((status.bits & StatusBits::overcurrent) != 0 && !fault_)
    fault_ = "the motor draws too much current: blocked or overloaded";
  reading.alarm = fault_;
  reading.position = position_of(status.position);
  return reading;
}

void AptAxis::send(const std::string& operation, std::span<const std::uint8_t> message, TimePoint deadline) {
  const std::lock_guard lock(link_mutex_);
  with_retries(operation, deadline, [&] { transmit(message, deadline); });
}

AxisState AptAxis::state(TimePoint deadline) {
  const MotionReading reading = read("read state", deadline);
  if (!reading.moving) may_be_moving_ = false;
  return {options_.dof.canonical(reading.position), reading.moving, reading.homed, reading.alarm};
}

void AptAxis::send_stop(TimePoint deadline) {
  const std::string operation = "stop";
  const std::lock_guard lock(link_mutex_);
  // Sent before all else: a controller that no longer answers may still hear.
  const auto stop = [&] {
    transmit(
        apt::short_message(Message::move_stop, options_.channel, stop_along_the_ramp, options_.controller),
        deadline);
  };
  // Bytes that were taken are not yet heard; an answer says that the controller still listens.
  with_retries(
      operation, deadline, [&] { (void)ask_status(operation, deadline); }, stop);
}

void AptAxis::stop_motion() {
  gate_.interrupt();
  send_stop(clock_.now() + stop_patience);
}

std::string AptAxis::stop_after_failure() {
  try {
    send_stop(clock_.now() + stop_patience);
    return "the controller was told to stop";
  } catch (const std::exception& error) {
    return fmt::format(
        "the controller could NOT be told to stop ({}); it may still be moving until it is there",
        error.what());
  }
}

MotionReading AptAxis::read_at_rest(const std::string& operation, AlarmHandling alarms, TimePoint deadline) {
  MotionReading reading = read(operation, deadline);
  if (reading.moving) {
    // Left over from an earlier life of this program, or started by the controller's own buttons.
    send_stop(deadline);
    const TimePoint patience = std::min(deadline, clock_.now() + standstill_patience);
    while ((reading = read(operation, deadline)).moving) {
      if (clock_.now() >= patience)
        throw DeviceError(options_.name, operation, "it still moves although told to stop");
      clock_.sleep_for(options_.patience.poll_interval);
    }
  }
  if (reading.alarm && alarms == AlarmHandling::clear) {
    forget_faults(operation, deadline);
    reading = read(operation, deadline);
  }
  if (reading.alarm)
    throw DeviceError(options_.name, operation,
                      fmt::format("alarm: {}; remove the cause, then home the axis", *reading.alarm));
  return reading;
}

void AptAxis::forget_faults(const std::string& operation, TimePoint deadline) {
  const std::lock_guard lock(link_mutex_);
  // The controller forgets a motion error when the channel is switched off and on.
  with_retries(operation, deadline, [&] {
    for (const std::uint8_t state : {channel_off, channel_on})
      transmit(apt::short_message(Message::set_channel_enabled, options_.channel, state, options_.controller),
               deadline);
  });
  fault_.reset();
}

MotionOrder AptAxis::order(MotionOrder::Goal goal, const std::string& operation, double target) const {
  return {options_.name, operation, options_.dof, goal, target, info_.arrival_tolerance, options_.patience};
}

MotionReading AptAxis::run(const MotionOrder& order, std::span<const std::uint8_t> command,
                           TimePoint deadline, const std::stop_token& stop) {
  MotionSteps steps;
  steps.start = [&] {
    may_be_moving_ = true;
    send(order.operation, command, deadline);
  };
  steps.read = [&] { return read(order.operation, deadline); };
  steps.finish = [this] { may_be_moving_ = false; };
  steps.halt = [this] { return stop_after_failure(); };
  return carry_out(order, steps, clock_, deadline, stop);
}

void AptAxis::home(TimePoint deadline, std::stop_token stop) {
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = "home";
  if (motion.token().stop_requested()) throw Interrupted();
  (void)read_at_rest(operation, AlarmHandling::clear, deadline);
  run(order(MotionOrder::Goal::home, operation, 0.0),
      apt::short_message(Message::move_home, options_.channel, 0, options_.controller), deadline,
      motion.token());
}

MotionReading AptAxis::read_ready_to_move(const std::string& operation, TimePoint deadline) {
  MotionReading reading = read_at_rest(operation, AlarmHandling::refuse, deadline);
  if (!reading.homed) throw DeviceError(options_.name, operation, "not homed; home the axis first");
  return reading;
}

double AptAxis::move_count_to(double position, const std::string& operation, TimePoint deadline,
                              const std::stop_token& stop) {
  const std::int32_t counts = counts_of(operation, position);
  const MotionReading after =
      run(order(MotionOrder::Goal::target, operation, position_of(counts)),
          apt::move_absolute(options_.channel, counts, options_.controller), deadline, stop);
  return options_.dof.canonical(after.position);
}

double AptAxis::move_to(double position, TimePoint deadline, std::stop_token stop) {
  check_target(options_.name, options_.dof, position);
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = fmt::format("move to {} {}", position, options_.dof.unit);
  if (motion.token().stop_requested()) throw Interrupted();
  const MotionReading before = read_ready_to_move(operation, deadline);
  return move_count_to(nearest_target(options_.dof, position, before.position), operation, deadline,
                       motion.token());
}

double AptAxis::jog(double distance, TimePoint deadline, std::stop_token stop) {
  check_jog(options_.name, options_.dof, distance);
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = fmt::format("jog by {} {}", distance, options_.dof.unit);
  if (motion.token().stop_requested()) throw Interrupted();
  const MotionReading before = read_ready_to_move(operation, deadline);
  if (!options_.dof.periodic) check_target(options_.name, options_.dof, before.position + distance);
  return move_count_to(before.position + distance, operation, deadline, motion.token());
}

}  // namespace eigenpose
