#include "drivers/modbus/profile.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

namespace eigenpose {

namespace {

constexpr int largest_write = 123;  ///< registers in one write, by the protocol

[[noreturn]] void refuse(const std::string& model, const std::string& what) {
  throw std::invalid_argument("profile of " + (model.empty() ? std::string("an unnamed drive") : model) +
                              ": " + what);
}

void check_number(const std::string& model, const std::string& name, const RegisterNumber& number) {
  if (number.bits != 16 && number.bits != 32)
    refuse(model, fmt::format("{}: {} bits; a number has 16 or 32", name, number.bits));
}

void check_bit(const std::string& model, const std::string& name, const StatusBit& bit) {
  if (bit.bit < 0 || bit.bit > 15) refuse(model, fmt::format("{}: bit {} is not in 0 … 15", name, bit.bit));
}

void check_writes(const std::string& model, const std::string& name, const RegisterWrites& writes) {
  for (const RegisterWrite& write : writes) {
    int registers = 0;
    for (const RegisterValue& value : write.values) {
      if (value.bits != 16 && value.bits != 32)
        refuse(model, fmt::format("{}: {} bits; a value has 16 or 32", name, value.bits));
      registers += value.bits / 16;
    }
    if (registers < 1 || registers > largest_write)
      refuse(model, fmt::format("{}: {} registers at {:#06x}; a write has 1 … {}", name, registers,
                                write.address, largest_write));
  }
}

bool mentions(const RegisterWrites& writes, RegisterMeaning meaning) {
  return std::any_of(writes.begin(), writes.end(), [&](const RegisterWrite& write) {
    return std::any_of(write.values.begin(), write.values.end(),
                       [&](const RegisterValue& value) { return value.meaning == meaning; });
  });
}

std::int64_t filled(const RegisterValue& value, const RegisterFill& fill) {
  switch (value.meaning) {
    case RegisterMeaning::constant:
      return value.constant;
    case RegisterMeaning::position:
      return fill.position;
    case RegisterMeaning::distance:
      return fill.distance;
    case RegisterMeaning::speed:
      return fill.speed;
    case RegisterMeaning::acceleration:
      return fill.acceleration;
    case RegisterMeaning::watchdog:
      return fill.watchdog;
    case RegisterMeaning::level:
      return fill.level;
  }
  return 0;
}

RegisterRange range_of(const RegisterValue& value, const RegisterFill& fill) {
  switch (value.meaning) {
    case RegisterMeaning::constant:
      return {signed_range(value.bits).least, unsigned_range(value.bits).most};
    case RegisterMeaning::position:
      return fill.position_is_signed ? signed_range(value.bits) : unsigned_range(value.bits);
    case RegisterMeaning::distance:
      return signed_range(value.bits);
    default:
      return unsigned_range(value.bits);
  }
}

}  // namespace

void ModbusProfile::check() const {
  if (model.empty()) refuse(model, "no model name");
  check_number(model, "position", position);
  if (alarm_code) check_number(model, "alarm code", *alarm_code);
  check_bit(model, "moving", moving);
  if (ready) check_bit(model, "ready", *ready);
  if (in_position) check_bit(model, "in position", *in_position);
  if (homed) check_bit(model, "homed", *homed);
  if (alarm) check_bit(model, "alarm", *alarm);
  if (!alarm && !alarm_code) refuse(model, "neither an alarm bit nor an alarm code: a fault would go unseen");
  for (const auto& [name, writes] :
       {std::pair{"connect", &connect}, std::pair{"prepare", &prepare}, std::pair{"home", &home},
        std::pair{"move", &move}, std::pair{"jog", &jog}, std::pair{"stop", &stop},
        std::pair{"clear_alarm", &clear_alarm}, std::pair{"arm_watchdog", &arm_watchdog},
        std::pair{"disarm_watchdog", &disarm_watchdog}})
    check_writes(model, name, *writes);
  if (stop.empty()) refuse(model, "no stop command: nothing could halt the motor");
  if (home.empty()) refuse(model, "no home command");
  if (!mentions(move, RegisterMeaning::position)) refuse(model, "the move command writes no position");
  if (!jog.empty() && !mentions(jog, RegisterMeaning::distance))
    refuse(model, "the jog command writes no distance");
  if (!arm_watchdog.empty() && disarm_watchdog.empty())
    refuse(model, "a watchdog that is armed but never disarmed would raise an alarm whenever the axis rests");
  const bool needs_turn =
      speed_unit == SpeedUnit::rpm || acceleration_unit == AccelerationUnit::ms_per_1000rpm;
  if (needs_turn && !(steps_per_turn > 0)) refuse(model, "speeds in turns need steps_per_turn above 0");
}

void ModbusLampProfile::check() const {
  if (model.empty()) refuse(model, "no model name");
  check_writes(model, "connect", connect);
  check_writes(model, "set_level", set_level);
  if (!mentions(set_level, RegisterMeaning::level)) refuse(model, "the set_level command writes no level");
  if (full < 1) refuse(model, fmt::format("full = {} is not above 0", full));
  const int bits = register_of(set_level, RegisterMeaning::level)->bits;
  if (!unsigned_range(bits).contains(full))
    refuse(model, fmt::format("full = {} does not fit the {} bits of the level", full, bits));
}

std::string ModbusProfile::describe_alarm(std::int64_t code) const {
  const auto found = alarms.find(code);
  return found != alarms.end()
             ? fmt::format("{} (code {:#04x})", found->second, code)
             : fmt::format("unknown alarm (code {:#04x}): see the manual of {}", code, model);
}

bool ModbusProfile::is_silence_alarm(std::int64_t code) const {
  return std::find(silence_alarms.begin(), silence_alarms.end(), code) != silence_alarms.end();
}

std::optional<RegisterNumber> register_of(const RegisterWrites& writes, RegisterMeaning meaning) {
  for (const RegisterWrite& write : writes) {
    int offset = 0;
    for (const RegisterValue& value : write.values) {
      if (value.meaning == meaning)
        return RegisterNumber{static_cast<std::uint16_t>(write.address + offset), value.bits, false};
      offset += value.bits / 16;
    }
  }
  return std::nullopt;
}

RegisterRange signed_range(int bits) {
  const std::int64_t half = std::int64_t{1} << (bits - 1);
  return {-half, half - 1};
}

RegisterRange unsigned_range(int bits) {
  return {0, (std::int64_t{1} << bits) - 1};
}

RegisterRange counter_range(const ModbusProfile& profile) {
  const auto range_of_bits = profile.position.is_signed ? signed_range : unsigned_range;
  RegisterRange range = range_of_bits(profile.position.bits);
  for (const RegisterWrite& write : profile.move)
    for (const RegisterValue& value : write.values) {
      if (value.meaning != RegisterMeaning::position) continue;
      const RegisterRange target = range_of_bits(value.bits);
      range = {std::max(range.least, target.least), std::min(range.most, target.most)};
    }
  return range;
}

std::vector<std::uint16_t> encode(const RegisterWrite& write, WordOrder order, const RegisterFill& fill) {
  std::vector<std::uint16_t> registers;
  for (const RegisterValue& value : write.values) {
    const std::int64_t number = filled(value, fill);
    if (!range_of(value, fill).contains(number))
      throw std::out_of_range(
          fmt::format("{} does not fit {} bits (register block {:#06x})", number, value.bits, write.address));
    const auto raw = static_cast<std::uint32_t>(number);
    const auto high = static_cast<std::uint16_t>(raw >> 16);
    const auto low = static_cast<std::uint16_t>(raw);
    if (value.bits == 16) {
      registers.push_back(low);
    } else {
      registers.push_back(order == WordOrder::high_first ? high : low);
      registers.push_back(order == WordOrder::high_first ? low : high);
    }
  }
  return registers;
}

std::int64_t decode(const RegisterNumber& number, WordOrder order, std::span<const std::uint16_t> registers) {
  if (registers.size() != static_cast<std::size_t>(number.bits / 16))
    throw std::invalid_argument(
        fmt::format("{} registers for a number of {} bits", registers.size(), number.bits));
  if (number.bits == 16)
    return number.is_signed ? static_cast<std::int64_t>(static_cast<std::int16_t>(registers[0]))
                            : static_cast<std::int64_t>(registers[0]);
  const std::uint32_t high = registers[order == WordOrder::high_first ? 0 : 1];
  const std::uint32_t low = registers[order == WordOrder::high_first ? 1 : 0];
  const std::uint32_t raw = (high << 16) | low;
  return number.is_signed ? static_cast<std::int64_t>(static_cast<std::int32_t>(raw))
                          : static_cast<std::int64_t>(raw);
}

}  // namespace eigenpose
