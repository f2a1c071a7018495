#include "sim/modbus/az_drive.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "sim/modbus/az_registers.h"

namespace eigenpose::sim {
namespace {

constexpr int alarm_position_deviation = 0x10;
constexpr int alarm_home_incomplete = 0x4A;
constexpr int alarm_software_overtravel = 0x67;
constexpr int alarm_operation_data = 0x70;
constexpr int alarm_communication_timeout = 0x85;

constexpr double in_position_steps =
    18.0;  // the manual's default: 1.8° at a motor of 1000 steps a turn, here as steps
constexpr double deviation_steps = 300.0;  // less than the manual's 3 turns, so that a stuck motor shows soon
constexpr double steps_per_motor_turn = 1000.0;
constexpr std::int32_t highest_speed = 4'000'000;     // steps/s
constexpr std::int32_t highest_rate = 1'000'000'000;  // steps/s²

Duration milliseconds_of(std::int32_t value) {
  return std::chrono::milliseconds(value);
}

}  // namespace

AzDrive::AzDrive(SimLab& lab, const DriveOptions& options, double speed_factor)
    : lab_(lab),
      options_(options),
      speed_factor_(speed_factor),
      command_(
          Trajectory::standstill((lab.axis_position_deg(options.axis, lab.clock().now()) - options.home_deg) *
                                     options.steps_per_degree,
                                 lab.clock().now())),
      zero_deg_(options.home_deg),
      homed_(options.homed),
      last_message_(lab.clock().now()) {
  if (options.unit < 1 || options.unit > 247) {
    throw std::invalid_argument("a Modbus unit is 1 … 247, not " + std::to_string(options.unit));
  }
  if (!(options.steps_per_degree > 0.0) || !(speed_factor > 0.0)) {
    throw std::invalid_argument("a simulated drive needs steps per degree and a speed factor above 0");
  }
  target_ = command_.position(lab.clock().now());
  const auto keep = [&](std::uint16_t address, std::int32_t value) {
    registers_[address] = static_cast<std::uint16_t>(static_cast<std::uint32_t>(value) >> 16U);
    registers_[address + 1] = static_cast<std::uint16_t>(value);
  };
  for (const RegisterRange& range : kept_ranges) {
    for (std::uint16_t address = range.first; address <= range.last; ++address) registers_[address] = 0;
  }
  keep(reg_operation_type, 2);
  keep(reg_speed, 1000);
  keep(reg_changing_rate, 1'000'000);
  keep(reg_stopping_rate, 1'000'000);
  keep(0x0064, 1000);
  keep(0x1380, options.unit);
}

MotionLimits AzDrive::scaled(double speed, double acceleration, double deceleration) const {
  const double f = speed_factor_;
  return {std::max(1.0, speed) * f, std::max(1.0, acceleration) * f * f, std::max(1.0, deceleration) * f * f};
}

std::int32_t AzDrive::stored(std::uint16_t even_address) const {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(registers_.at(even_address)) << 16U |
                                   registers_.at(static_cast<std::uint16_t>(even_address + 1)));
}

double AzDrive::feedback(TimePoint now) const {
  return stuck_at_ ? *stuck_at_ : command_.position(now) - slipped_;
}

bool AzDrive::ready(TimePoint now) const {
  return alarm_ == 0 && (input_ & (in_stop | in_free)) == 0 && !command_.moving(now);
}

std::uint16_t AzDrive::output_bits() const {
  const TimePoint now = lab_.clock().now();
  const bool moving = command_.moving(now);
  unsigned bits = 0;
  if (homed_) bits |= out_home_end;
  if (ready(now)) bits |= out_ready;
  if (alarm_ != 0) bits |= out_alarm;
  if (moving) bits |= out_move;
  if (!moving && std::abs(feedback(now) - target_) <= in_position_steps) bits |= out_in_position;
  return static_cast<std::uint16_t>(bits);
}

std::uint32_t AzDrive::pair_value(std::uint16_t even_address) const {
  const TimePoint now = lab_.clock().now();
  const auto whole = [](double value) { return static_cast<std::uint32_t>(std::llround(value)); };
  const double command_hz = command_.velocity(now) / speed_factor_;
  const double feedback_hz = stuck_at_ ? 0.0 : command_hz;
  switch (even_address) {
    case reg_output:
      return output_bits();
    case reg_alarm:
      return static_cast<std::uint32_t>(alarm_);
    case reg_command_position:
      return whole(command_.position(now));
    case reg_command_speed_rpm:
      return whole(60.0 * command_hz / steps_per_motor_turn);
    case reg_command_speed_hz:
      return whole(command_hz);
    case reg_feedback_position:
      return whole(feedback(now));
    case reg_feedback_speed_rpm:
      return whole(60.0 * feedback_hz / steps_per_motor_turn);
    case reg_feedback_speed_hz:
      return whole(feedback_hz);
    default:
      return static_cast<std::uint32_t>(stored(even_address));
  }
}

std::optional<std::uint16_t> AzDrive::value_of(std::uint16_t address) const {
  if (!within(kept_ranges, address) && !within(monitor_ranges, address)) return std::nullopt;
  const auto even = static_cast<std::uint16_t>(address & ~1U);
  const std::uint32_t value = pair_value(even);
  return static_cast<std::uint16_t>(address == even ? value >> 16U : value);
}

ModbusException AzDrive::read(std::uint16_t address, std::span<std::uint16_t> values) {
  const std::lock_guard lock(mutex_);
  update(lab_.clock().now());
  if (address + values.size() > 0x10000) return ModbusException::illegal_address;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = value_of(static_cast<std::uint16_t>(address + i));
    if (!value) return ModbusException::illegal_address;
    values[i] = *value;
  }
  return ModbusException::none;
}

ModbusException AzDrive::write(std::uint16_t address, std::span<const std::uint16_t> values) {
  const std::lock_guard lock(mutex_);
  const TimePoint now = lab_.clock().now();
  update(now);
  if (address + values.size() > 0x10000) return ModbusException::illegal_address;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!within(kept_ranges, static_cast<std::uint16_t>(address + i)))
      return ModbusException::illegal_address;
  }
  const auto before = registers_;
  for (std::size_t i = 0; i < values.size(); ++i)
    registers_[static_cast<std::uint16_t>(address + i)] = values[i];
  const auto last = static_cast<std::uint16_t>(address + values.size() - 1);
  const auto touched = [&](std::uint16_t even) { return address <= even + 1 && last >= even; };

  const std::int32_t timeout = stored(reg_communication_timeout);
  const std::int32_t speed = stored(reg_speed);
  if (timeout < 0 || timeout > 10000 || speed < -highest_speed || speed > highest_speed ||
      stored(reg_changing_rate) < 1 || stored(reg_changing_rate) > highest_rate ||
      stored(reg_stopping_rate) < 1 || stored(reg_stopping_rate) > highest_rate) {
    registers_ = before;
    return ModbusException::device_failure;
  }
  if (touched(reg_input) && !apply_input(registers_[reg_input + 1], now))
    return ModbusException::device_failure;
  if (touched(reg_input_automatic_off)) {
    const std::uint16_t pulse = registers_[reg_input_automatic_off + 1];
    registers_[reg_input_automatic_off + 1] = 0;
    const std::uint16_t level = input_;
    const bool accepted = apply_input(static_cast<std::uint16_t>(level | pulse), now);
    apply_input(level, now);
    if (!accepted) return ModbusException::device_failure;
  }
  if (touched(reg_alarm_reset) && stored(reg_alarm_reset) == 1) reset_alarm();
  if (touched(reg_preset) && stored(reg_preset) == 1) preset(now);
  return trigger_after_write(address, last, now);
}

ModbusException AzDrive::trigger_after_write(std::uint16_t first, std::uint16_t last, TimePoint now) {
  if (last < reg_data_number || first > reg_trigger + 1) return ModbusException::none;
  const std::int32_t trigger = stored(reg_trigger);
  if (trigger == 1) {
    registers_[reg_trigger] = 0;
    registers_[reg_trigger + 1] = 0;
    return start_direct_operation(now);
  }
  // −1 waits for the current to be written, −2 the stopping rate … −7 the data number.
  if (trigger <= -1 && trigger >= -7) {
    const auto item = static_cast<std::uint16_t>(0x0064 + 2 * (trigger + 1));
    if (first <= item + 1 && last >= item) return start_direct_operation(now);
  }
  return ModbusException::none;
}

// Operation types 7 and 16 turn without an end; the others go to a target.
ModbusException AzDrive::start_direct_operation(TimePoint now) {
  if (alarm_ != 0 || (input_ & (in_stop | in_free)) != 0 || homing_) return ModbusException::device_failure;
  const std::int32_t type = stored(reg_operation_type);
  const double speed = stored(reg_speed);
  const MotionLimits limits = scaled(std::abs(speed), stored(reg_changing_rate), stored(reg_stopping_rate));
  const bool needs_home = type == 1 || (type >= 8 && type != 16);
  if (needs_home && !homed_) {
    alarm_now(alarm_home_incomplete, now);
    return ModbusException::none;
  }
  if (type == 7 || type == 16) {
    slipped_ = 0.0;
    move(speed == 0.0 ? command_.stop(limits.deceleration, now)
                      : command_.run(speed > 0.0 ? 1 : -1, limits, now),
         now);
    return ModbusException::none;
  }
  const std::optional<double> target = direct_target(type, now);
  if (!target) {
    alarm_now(alarm_operation_data, now);
    return ModbusException::none;
  }
  go_to(*target, limits, now);
  return ModbusException::none;
}

std::optional<double> AzDrive::direct_target(std::int32_t type, TimePoint now) const {
  const double position = stored(reg_position);
  const double turn = 360.0 * options_.steps_per_degree;
  const double here = command_.position(now);
  switch (type) {
    case 1:
      return position;
    case 2:
      return here + position;
    case 3:
      return feedback(now) + position;
    case 8:
      return std::floor(here / turn) * turn + position;
    case 9:
      return here + circular_difference(position, here, turn);
    case 10:
      return here + wrap(position - here, 0.0, turn);
    case 11:
      return here - wrap(here - position, 0.0, turn);
    default:
      return std::nullopt;
  }
}

void AzDrive::go_to(double target, const MotionLimits& limits, TimePoint now) {
  alarm_at_rest_.reset();
  const auto limit = [&](const std::optional<double>& degrees, double none) {
    return degrees ? (*degrees - zero_deg_) * options_.steps_per_degree : none;
  };
  const double reached = std::clamp(target, limit(options_.lower_deg, -1e9), limit(options_.upper_deg, 1e9));
  if (reached != target) alarm_at_rest_ = alarm_software_overtravel;
  // A motor that stands off its command, after a slip, is commanded from where it is.
  if (!command_.moving(now) && slipped_ != 0.0) command_ = Trajectory::standstill(feedback(now), now);
  slipped_ = 0.0;
  target_ = reached;
  move(command_.move_to(reached, limits, now), now);
}

void AzDrive::start_homing(TimePoint now) {
  homed_ = false;
  homing_ = true;
  slipped_ = 0.0;
  target_ = 0.0;
  const double rate = 10.0 * options_.homing_speed;
  move(command_.move_to(0.0, scaled(options_.homing_speed, rate, rate), now), now);
}

void AzDrive::preset(TimePoint now) {
  const double here = feedback(now);
  zero_deg_ += here / options_.steps_per_degree;
  command_ = Trajectory::standstill(0.0, now);
  slipped_ = 0.0;
  target_ = 0.0;
  homed_ = true;
  registers_[reg_preset + 1] = 0;
}

void AzDrive::reset_alarm() {
  alarm_ = 0;
  registers_[reg_alarm_reset + 1] = 0;
  last_message_ = lab_.clock().now();
  if (stuck_at_ && !faults_.stuck) stuck_at_.reset();
}

// Inputs act on their edge or level, in the order of their urgency.
bool AzDrive::apply_input(std::uint16_t bits, TimePoint now) {
  const unsigned risen = bits & static_cast<unsigned>(~input_);
  const unsigned fallen = static_cast<unsigned>(input_) & ~static_cast<unsigned>(bits);
  const unsigned jog = in_forward | in_reverse;
  input_ = bits;
  const MotionLimits jog_limits =
      scaled(options_.jog_speed, options_.jog_acceleration, options_.jog_acceleration);
  if ((risen & in_alarm_reset) != 0) reset_alarm();
  if ((bits & in_free) != 0) {
    homing_ = false;
    alarm_at_rest_.reset();
    if (command_.moving(now)) move(command_.freeze(now), now);
  }
  if ((bits & in_stop) != 0 && command_.moving(now)) {
    homing_ = false;
    alarm_at_rest_.reset();
    if ((risen & in_stop) != 0) {
      move(command_.stop(scaled(1.0, 1.0, stored(reg_stopping_rate)).deceleration, now), now);
    }
  }
  if ((fallen & jog) != 0 && (bits & jog) == 0 && command_.moving(now)) {
    move(command_.stop(jog_limits.deceleration, now), now);
  }
  if ((risen & in_unserved) != 0) return false;
  if ((risen & (in_zhome | jog)) == 0) return true;
  if (alarm_ != 0 || (bits & (in_stop | in_free)) != 0) return false;
  if ((risen & in_zhome) != 0) {
    start_homing(now);
  } else {
    move(command_.run((risen & in_forward) != 0 ? 1 : -1, jog_limits, now), now);
  }
  return true;
}

void AzDrive::alarm_now(int code, TimePoint now) {
  alarm_ = code;
  homing_ = false;
  alarm_at_rest_.reset();
  if (command_.moving(now)) {
    move(command_.stop(scaled(1.0, 1.0, stored(reg_stopping_rate)).deceleration, now), now);
  }
}

void AzDrive::move(const Trajectory& command, TimePoint now) {
  if (faults_.slip_steps != 0.0 && command.moving(now)) {
    slipped_ = faults_.slip_steps;
    faults_.slip_steps = 0.0;
  }
  const TimePoint later = std::min(command.end(), now + std::chrono::hours(1));
  const double way = command.position(later) - command.position(now);
  command_ = command;
  if (!command_.moving(now)) target_ = command_.position(now);
  if (homing_ && !command_.moving(now)) update(now);
  if (stuck_at_) return;
  const double lag = way == 0.0 ? 0.0 : 0.5 * std::copysign(faults_.backlash_deg, way);
  lab_.set_axis_motion(
      options_.axis,
      command_.shifted(-slipped_).scaled(1.0 / options_.steps_per_degree).shifted(zero_deg_ - lag));
}

void AzDrive::update(TimePoint now) {
  if (homing_ && !command_.moving(now)) {
    homing_ = false;
    homed_ = std::abs(feedback(now)) <= in_position_steps;
    if (!homed_) alarm_now(alarm_home_incomplete, now);
  }
  if (alarm_at_rest_ && !command_.moving(now)) alarm_now(*alarm_at_rest_, now);
  if (stuck_at_ && alarm_ == 0 && std::abs(command_.position(now) - *stuck_at_) > deviation_steps) {
    alarm_now(alarm_position_deviation, now);
    command_ = Trajectory::standstill(*stuck_at_, now);
  }
  const std::int32_t timeout = stored(reg_communication_timeout);
  if (timeout > 0 && alarm_ == 0 && now - last_message_ > milliseconds_of(timeout)) {
    alarm_now(alarm_communication_timeout, now);
  }
}

void AzDrive::note_message() {
  const std::lock_guard lock(mutex_);
  update(lab_.clock().now());
  last_message_ = lab_.clock().now();
}

void AzDrive::tick() {
  const std::lock_guard lock(mutex_);
  update(lab_.clock().now());
}

void AzDrive::set_faults(const DriveFaults& faults) {
  const std::lock_guard lock(mutex_);
  const TimePoint now = lab_.clock().now();
  update(now);
  if ((faults.stuck || faults.dead) && !stuck_at_) {
    stuck_at_ = feedback(now);
    lab_.set_axis_motion(options_.axis,
                         Trajectory::standstill(*stuck_at_ / options_.steps_per_degree + zero_deg_, now));
  }
  if (!faults.stuck && !faults.dead && stuck_at_) {
    command_ = Trajectory::standstill(*stuck_at_, now);
    slipped_ = 0.0;
    stuck_at_.reset();
  }
  if (faults.dead && !faults_.dead) {
    homed_ = false;
    homing_ = false;
    alarm_at_rest_.reset();
  }
  faults_ = faults;
}

DriveFaults AzDrive::faults() const {
  const std::lock_guard lock(mutex_);
  return faults_;
}

void AzDrive::raise_alarm(int code) {
  const std::lock_guard lock(mutex_);
  alarm_now(code, lab_.clock().now());
}

int AzDrive::alarm() const {
  const std::lock_guard lock(mutex_);
  return alarm_;
}

}  // namespace eigenpose::sim
