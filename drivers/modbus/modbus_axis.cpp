#include "drivers/modbus/modbus_axis.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;

constexpr int mergeable_gap = 4;        ///< registers read for nothing rather than asked for apart
constexpr Duration stop_patience = 3s;  ///< for telling the drive to stop, whatever the caller's deadline
constexpr Duration standstill_patience = 5s;  ///< for a motor that is told to stop to stand

void check(const ModbusAxisOptions& options) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("axis " + options.name + ": " + what);
  };
  if (options.name.empty()) throw std::invalid_argument("a Modbus axis needs a name");
  if (!(options.dof.lower < options.dof.upper))
    refuse(fmt::format("range {} … {} is empty", options.dof.lower, options.dof.upper));
  if (options.unit < 1 || options.unit > 247)
    refuse(fmt::format("Modbus unit must be 1 … 247, got {}", options.unit));
  if (!(options.steps_per_unit > 0) || !std::isfinite(options.steps_per_unit))
    refuse(fmt::format("steps per {} must be above 0, got {}", options.dof.unit, options.steps_per_unit));
  if (!(options.speed > 0)) refuse(fmt::format("speed must be above 0, got {}", options.speed));
  if (!(options.acceleration > 0))
    refuse(fmt::format("acceleration must be above 0, got {}", options.acceleration));
  if (!(options.arrival_tolerance >= 0))
    refuse(fmt::format("arrival tolerance must not be negative, got {}", options.arrival_tolerance));
  if (!std::isfinite(options.zero_offset)) refuse("zero offset must be a number");
  if (options.patience.poll_interval <= Duration::zero()) refuse("poll interval must be above 0");
  if (options.watchdog < Duration::zero() || options.watchdog > 10s) refuse("watchdog must be 0 … 10 s");
}

}  // namespace

ModbusAxis::ModbusAxis(ModbusProfile profile, ModbusAxisOptions options, std::shared_ptr<ModbusBus> bus,
                       const Clock& clock)
    : profile_(std::move(profile)), options_(std::move(options)), bus_(std::move(bus)), clock_(clock) {
  if (!bus_) throw std::invalid_argument("axis " + options_.name + ": no Modbus bus");
  profile_.check();
  check(options_);
  counter_ = counter_range(profile_);
  info_.dof = options_.dof;
  info_.model = profile_.model;
  info_.resolution = 1.0 / options_.steps_per_unit;
  info_.arrival_tolerance =
      options_.arrival_tolerance > 0 ? options_.arrival_tolerance : 2.0 * info_.resolution;

  std::set<int> addresses = {profile_.moving.address};
  for (const auto* bit : {&profile_.ready, &profile_.in_position, &profile_.homed, &profile_.alarm})
    if (*bit) addresses.insert((*bit)->address);
  if (profile_.alarm_code)
    for (int i = 0; i < profile_.alarm_code->bits / 16; ++i)
      addresses.insert(profile_.alarm_code->address + i);
  for (const int address : addresses) {
    if (!status_blocks_.empty()) {
      Block& block = status_blocks_.back();
      if (address - (block.address + block.count) < mergeable_gap) {
        block.count = address - block.address + 1;
        continue;
      }
    }
    status_blocks_.push_back({static_cast<std::uint16_t>(address), 1});
  }
}

ModbusAxis::~ModbusAxis() {
  if (!may_be_moving_) return;
  try {
    send_stop(clock_.now() + stop_patience);
  } catch (const std::exception&) {
    // Nobody is left to report to; the drive's own watchdog is armed where there is one.
  }
}

double ModbusAxis::position_of(std::int64_t steps) const {
  const double counted = static_cast<double>(steps) / options_.steps_per_unit;
  return (options_.reversed ? -counted : counted) - options_.zero_offset;
}

std::int64_t ModbusAxis::steps_of(double position) const {
  const double from_home = position + options_.zero_offset;
  return std::llround((options_.reversed ? -from_home : from_home) * options_.steps_per_unit);
}

void ModbusAxis::check_counter(const std::string& operation, std::int64_t steps) const {
  if (counter_.contains(steps)) return;
  throw DeviceError(options_.name, operation,
                    fmt::format("that is {} steps, and the drive counts from {} to {}; home the axis, or set "
                                "fewer steps per {}",
                                steps, counter_.least, counter_.most, options_.dof.unit));
}

RegisterFill ModbusAxis::motion_fill() const {
  const double steps_per_s = options_.speed * options_.steps_per_unit;
  const double steps_per_s2 = options_.acceleration * options_.steps_per_unit;
  RegisterFill fill;
  fill.position_is_signed = profile_.position.is_signed;
  fill.speed = std::llround(
      profile_.speed_unit == SpeedUnit::rpm ? steps_per_s / profile_.steps_per_turn * 60.0 : steps_per_s);
  fill.acceleration = std::llround(profile_.acceleration_unit == AccelerationUnit::ms_per_1000rpm
                                       ? 1000.0 * (1000.0 / 60.0 * profile_.steps_per_turn) / steps_per_s2
                                       : steps_per_s2);
  fill.speed = std::max<std::int64_t>(1, fill.speed);
  fill.acceleration = std::max<std::int64_t>(1, fill.acceleration);
  fill.watchdog = std::chrono::duration_cast<std::chrono::milliseconds>(options_.watchdog).count();
  return fill;
}

ModbusAxis::Reading ModbusAxis::read(const std::string& operation, TimePoint deadline) {
  const ModbusCaller caller{options_.name, operation, options_.unit};
  std::map<std::uint16_t, std::uint16_t> registers;
  for (const Block& block : status_blocks_) {
    const auto values = bus_->read(caller, block.address, block.count, deadline);
    for (std::size_t i = 0; i < values.size(); ++i)
      registers[static_cast<std::uint16_t>(block.address + i)] = values[i];
  }
  // The position comes last: what a status of "stands still" is believed of was read after it.
  const auto position = bus_->read(caller, profile_.position.address, profile_.position.bits / 16, deadline);

  const auto holds = [&](const StatusBit& bit) {
    return ((registers[bit.address] >> bit.bit & 1) != 0) == bit.active;
  };
  Reading reading;
  reading.moving = holds(profile_.moving);
  if (profile_.ready) reading.ready = holds(*profile_.ready);
  if (profile_.in_position) reading.in_position = holds(*profile_.in_position);
  reading.homed = profile_.homed ? holds(*profile_.homed) : homed_here_;
  std::int64_t code = 0;
  if (profile_.alarm_code) {
    std::vector<std::uint16_t> values;
    values.reserve(2);
    for (int i = 0; i < profile_.alarm_code->bits / 16; ++i)
      values.push_back(registers[static_cast<std::uint16_t>(profile_.alarm_code->address + i)]);
    code = decode(*profile_.alarm_code, profile_.word_order, values);
  }
  if (profile_.alarm ? holds(*profile_.alarm) : code != 0) {
    reading.alarm = code != 0 ? profile_.describe_alarm(code) : "alarm (the drive gives no reason)";
    reading.silence_alarm = code != 0 && profile_.is_silence_alarm(code);
  }
  reading.steps = decode(profile_.position, profile_.word_order, position);
  reading.position = position_of(reading.steps);
  return reading;
}

void ModbusAxis::write(const std::string& operation, const RegisterWrites& writes, const RegisterFill& fill,
                       TimePoint deadline, Sending sending) {
  const ModbusCaller caller{options_.name, operation, options_.unit, sending == Sending::urgent,
                            sending == Sending::once};
  for (const RegisterWrite& one : writes) {
    std::vector<std::uint16_t> values;
    try {
      values = encode(one, profile_.word_order, fill);
    } catch (const std::out_of_range& error) {
      throw DeviceError(options_.name, operation,
                        std::string("the drive cannot be told this number: ") + error.what());
    }
    bus_->write(caller, one.address, values, deadline);
  }
}

AxisState ModbusAxis::state(TimePoint deadline) {
  const Reading reading = read("read state", deadline);
  if (!reading.moving) may_be_moving_ = false;
  return {options_.dof.canonical(reading.position), reading.moving, reading.homed, reading.alarm};
}

void ModbusAxis::send_stop(TimePoint deadline) {
  write("stop", profile_.stop, {}, deadline, Sending::urgent);
}

void ModbusAxis::stop_motion() {
  gate_.interrupt();
  send_stop(clock_.now() + stop_patience);
}

std::string ModbusAxis::stop_after_failure() {
  try {
    send_stop(clock_.now() + stop_patience);
  } catch (const std::exception& error) {
    return fmt::format(
        "the drive could NOT be told to stop ({}); {}", error.what(),
        watchdog_armed_
            ? fmt::format("its own watchdog stops it after {} ms of silence",
                          std::chrono::duration_cast<std::chrono::milliseconds>(options_.watchdog).count())
            : "it may still be moving: use its emergency stop");
  }
  try {
    disarm_watchdog("stop", clock_.now() + stop_patience);
  } catch (const std::exception&) {
    // Then it raises an alarm of silence, which the next motion clears.
  }
  return "the drive was told to stop";
}

void ModbusAxis::arm_watchdog(const std::string& operation, TimePoint deadline) {
  if (profile_.arm_watchdog.empty() || options_.watchdog == Duration::zero()) return;
  watchdog_armed_ = true;
  write(operation, profile_.arm_watchdog, motion_fill(), deadline);
}

void ModbusAxis::disarm_watchdog(const std::string& operation, TimePoint deadline) {
  if (!watchdog_armed_) return;
  write(operation, profile_.disarm_watchdog, {}, deadline);
  watchdog_armed_ = false;
}

void ModbusAxis::clear_alarm(const std::string& operation, TimePoint deadline) {
  write(operation, profile_.clear_alarm, {}, deadline);
}

void ModbusAxis::set_up_after_connecting(const std::string& operation, TimePoint deadline) {
  write(operation, profile_.connect, {}, deadline);
  if (bus_->connection_number() != set_up_connection_) homed_here_ = false;
  set_up_connection_ = bus_->connection_number();
}

ModbusAxis::Reading ModbusAxis::wait_for_standstill(const std::string& operation, TimePoint deadline) {
  const TimePoint patience = std::min(deadline, clock_.now() + standstill_patience);
  for (;;) {
    Reading reading = read(operation, deadline);
    if (!reading.moving) return reading;
    if (clock_.now() >= patience)
      throw DeviceError(options_.name, operation,
                        fmt::format("it still moves although told to stop (at {:.3f} {})",
                                    options_.dof.canonical(reading.position), options_.dof.unit));
    clock_.sleep_for(options_.patience.poll_interval);
  }
}

ModbusAxis::Reading ModbusAxis::read_ready_to_move(const std::string& operation, AlarmHandling alarms,
                                                   TimePoint deadline, const std::stop_token& stop) {
  Reading reading = read(operation, deadline);
  if (bus_->connection_number() != set_up_connection_) {
    set_up_after_connecting(operation, deadline);
    reading = read(operation, deadline);
  }
  if (reading.moving) {
    // Left over from an earlier life of this program, or started by somebody else.
    send_stop(deadline);
    reading = wait_for_standstill(operation, deadline);
  }
  const bool may_clear = reading.silence_alarm || alarms == AlarmHandling::clear;
  if (reading.alarm && !profile_.clear_alarm.empty() && may_clear) {
    clear_alarm(operation, deadline);
    reading = read(operation, deadline);
  }
  if (reading.alarm)
    throw DeviceError(options_.name, operation,
                      fmt::format("alarm: {}; remove the cause, then home the axis", *reading.alarm));

  write(operation, profile_.prepare, {}, deadline);
  return wait_until_ready(operation, deadline, stop);
}

ModbusAxis::Reading ModbusAxis::wait_until_ready(const std::string& operation, TimePoint deadline,
                                                 const std::stop_token& stop) {
  const TimePoint patience = std::min(deadline, clock_.now() + options_.patience.start_time);
  bool set_up_again = false;
  for (;;) {
    Reading reading = read(operation, deadline);
    if (reading.ready) return reading;
    heed(stop, options_.name, operation);
    if (!set_up_again) {
      // A drive that was switched off and on behind its gateway has forgotten what it was told.
      set_up_after_connecting(operation, deadline);
      set_up_again = true;
    }
    if (clock_.now() >= patience)
      throw DeviceError(options_.name, operation,
                        "the drive is not ready: is its power on and the motor enabled?");
    clock_.sleep_until(clock_.now() + options_.patience.poll_interval, stop);
  }
}

MotionReading ModbusAxis::run(MotionOrder::Goal goal, const std::string& operation, const Command& command,
                              TimePoint deadline, const std::stop_token& stop) {
  const MotionOrder order{
      options_.name,           operation,        options_.dof, goal, position_of(command.fill.position),
      info_.arrival_tolerance, options_.patience};
  MotionSteps steps;
  steps.start = [&] {
    may_be_moving_ = true;
    arm_watchdog(operation, deadline);
    heed(stop, options_.name, operation);
    write(operation, command.writes, command.fill, deadline, command.sending);
  };
  steps.read = [&] {
    const Reading all = read(operation, deadline);
    MotionReading reading = static_cast<const MotionReading&>(all);
    // Of a drive without a homed bit nothing but its standstill says that homing has ended.
    if (goal == MotionOrder::Goal::home && !profile_.homed) reading.homed = true;
    return reading;
  };
  steps.finish = [&] {
    may_be_moving_ = false;
    disarm_watchdog(operation, deadline);
  };
  steps.halt = [this] { return stop_after_failure(); };
  return carry_out(order, steps, clock_, deadline, stop);
}

void ModbusAxis::home(TimePoint deadline, std::stop_token stop) {
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = "home";
  if (motion.token().stop_requested()) throw Interrupted();
  read_ready_to_move(operation, AlarmHandling::clear, deadline, motion.token());
  RegisterFill fill = motion_fill();
  fill.position = steps_of(-options_.zero_offset);
  homed_here_ = false;
  const MotionReading reading =
      run(MotionOrder::Goal::home, operation, {profile_.home, fill}, deadline, motion.token());
  if (profile_.home_steps &&
      std::abs(reading.position - position_of(*profile_.home_steps)) > info_.arrival_tolerance)
    throw DeviceError(options_.name, operation,
                      fmt::format("homing ended at {} steps instead of {}", steps_of(reading.position),
                                  *profile_.home_steps));
  homed_here_ = true;
}

double ModbusAxis::move_to(double position, TimePoint deadline, std::stop_token stop) {
  const Dof& dof = options_.dof;
  check_target(options_.name, dof, position);
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = fmt::format("move to {} {}", position, dof.unit);
  if (motion.token().stop_requested()) throw Interrupted();
  const Reading before = read_ready_to_move(operation, AlarmHandling::refuse, deadline, motion.token());
  if (!before.homed) throw DeviceError(options_.name, operation, "not homed; home the axis first");

  RegisterFill fill = motion_fill();
  // The drive counts on over whole turns; the way to go is the short one from where it is.
  fill.position = steps_of(nearest_target(dof, position, before.position));
  if (!counter_.contains(fill.position) && dof.periodic) {
    // The counter is at its end: the long way, once in a lifetime.
    fill.position = steps_of(dof.canonical(position));
  }
  check_counter(operation, fill.position);
  const MotionReading after =
      run(MotionOrder::Goal::target, operation, {profile_.move, fill}, deadline, motion.token());
  return dof.canonical(after.position);
}

double ModbusAxis::jog(double distance, TimePoint deadline, std::stop_token stop) {
  const Dof& dof = options_.dof;
  check_jog(options_.name, dof, distance);
  const MotionGate::Passage motion(gate_, stop);
  const std::string operation = fmt::format("jog by {} {}", distance, dof.unit);
  if (motion.token().stop_requested()) throw Interrupted();
  const Reading before = read_ready_to_move(operation, AlarmHandling::refuse, deadline, motion.token());
  const bool by_distance = !profile_.jog.empty();
  if (!before.homed && !by_distance)
    throw DeviceError(options_.name, operation, "not homed; home the axis first");
  if (!before.homed)
    check_unhomed_jog(options_.name, dof, distance);
  else if (!dof.periodic)
    check_target(options_.name, dof, before.position + distance);

  RegisterFill fill = motion_fill();
  fill.distance = std::llround((options_.reversed ? -distance : distance) * options_.steps_per_unit);
  fill.position = before.steps + fill.distance;
  check_counter(operation, fill.position);
  const Command command =
      by_distance ? Command{profile_.jog, fill, Sending::once} : Command{profile_.move, fill};
  const MotionReading after = run(MotionOrder::Goal::target, operation, command, deadline, motion.token());
  return dof.canonical(after.position);
}

}  // namespace eigenpose
