#pragma once

/// What a Modbus drive's register map looks like, so that one driver serves many makes.
///
/// A profile is data: it says where the position stands, which status bits mean what, and which registers to
/// write to home, move and stop. config/profiles holds one file for each make; config/modbus_profile.h reads
/// them. Addresses are the protocol's own, counted from 0 (a manual that counts from 40001 is 40001 too
/// high).

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/clock.h"

namespace eigenpose {

/// Which register of a 32-bit value comes first. Within a register the protocol itself is big-endian.
enum class WordOrder { high_first, low_first };

/// What a written value stands for; all but `constant` are filled in by the driver when it writes.
enum class RegisterMeaning {
  constant,
  position,      ///< target, absolute, in the drive's steps
  distance,      ///< signed way to go, in the drive's steps
  speed,         ///< in the profile's `speed_unit`
  acceleration,  ///< in the profile's `acceleration_unit`
  watchdog,      ///< silence after which the drive stops by itself, in milliseconds
  level          ///< brightness of a lamp, 0 … `ModbusLampProfile::full`
};

/// One value of a write: what it is, and how many registers it takes.
struct RegisterValue {
  RegisterMeaning meaning = RegisterMeaning::constant;
  std::int64_t constant = 0;  ///< for `constant` only
  int bits = 16;              ///< 16 or 32
};

/// One write transaction: the values stand one after the other from `address` on.
struct RegisterWrite {
  std::uint16_t address = 0;
  std::vector<RegisterValue> values;
};

using RegisterWrites = std::vector<RegisterWrite>;

/// One bit of a status register.
struct StatusBit {
  std::uint16_t address = 0;
  int bit = 0;         ///< 0 (least) … 15
  bool active = true;  ///< the statement holds when the bit is 1 (true) or 0 (false)
};

/// A number that the drive shows.
struct RegisterNumber {
  std::uint16_t address = 0;
  int bits = 32;  ///< 16 or 32
  bool is_signed = true;
};

enum class SpeedUnit { steps_per_s, rpm };
enum class AccelerationUnit {
  steps_per_s2,
  ms_per_1000rpm  ///< time to change the speed by 1000 turns a minute
};

/// The drive's factory settings on RS-485, used unless the rig says otherwise.
struct SerialDefaults {
  int baud = 115200;
  char parity = 'E';  ///< 'N', 'E', 'O'
  int stop_bits = 1;
  Duration silent_interval{};  ///< what the drive wants between frames, beyond the protocol's 3.5 characters
};

/// What an axis gets of which the rig says nothing. "Unit" is the axis's unit, degrees or millimetres.
struct AxisDefaults {
  double steps_per_unit = 100.0;                ///< steps of the drive for one unit, gears included
  double speed = 20.0;                          ///< unit/s
  double acceleration = 40.0;                   ///< unit/s²
  double arrival_tolerance = 0.0;               ///< in the unit; 0: two steps
  Duration watchdog = std::chrono::seconds(2);  ///< silence after which a moving drive stops by itself
};

/// The whole map. `check` says whether it can be used.
struct ModbusProfile {
  std::string model;  ///< "Oriental Motor AZ"
  WordOrder word_order = WordOrder::high_first;
  SerialDefaults serial;
  AxisDefaults defaults;

  double steps_per_turn = 0.0;  ///< of the motor as delivered; only to convert rpm, 0 if no unit needs it
  SpeedUnit speed_unit = SpeedUnit::steps_per_s;
  AccelerationUnit acceleration_unit = AccelerationUnit::steps_per_s2;

  RegisterNumber position;               ///< where the axis *is*: the feedback position where there is one
  StatusBit moving;                      ///< the motor turns or a command is being carried out
  std::optional<StatusBit> ready;        ///< a new command would be taken
  std::optional<StatusBit> in_position;  ///< the motor stands within the drive's own window
  std::optional<StatusBit> homed;        ///< without it the driver knows only homings it has done itself
  std::optional<StatusBit> alarm;        ///< without it the alarm number alone tells

  std::optional<RegisterNumber> alarm_code;    ///< 0: none
  std::map<std::int64_t, std::string> alarms;  ///< code → words
  /// Codes that only say that nobody has spoken to the drive: the driver clears these itself before a move.
  std::vector<std::int64_t> silence_alarms;

  /// Where the drive's counter stands at home, when it always stands there after homing; checked when given.
  std::optional<std::int64_t> home_steps;

  RegisterWrites connect;  ///< once after each connection: enabling the motor, input mode
  RegisterWrites prepare;  ///< before each home, move and jog: takes a stop order back
  RegisterWrites home;
  RegisterWrites move;  ///< absolute
  RegisterWrites jog;   ///< relative to where the motor is; empty: this drive cannot
  RegisterWrites stop;
  RegisterWrites clear_alarm;   ///< empty: this drive cannot by Modbus
  RegisterWrites arm_watchdog;  ///< empty: this drive has none
  RegisterWrites disarm_watchdog;

  /// @throws std::invalid_argument naming what is missing or impossible.
  void check() const;
  /// "overload (code 0x30)", or "unknown alarm (code 0x99): see the drive's manual".
  [[nodiscard]] std::string describe_alarm(std::int64_t code) const;
  [[nodiscard]] bool is_silence_alarm(std::int64_t code) const;
};

/// Where the first value of `meaning` stands when `writes` are done; nothing if none of them has it.
std::optional<RegisterNumber> register_of(const RegisterWrites& writes, RegisterMeaning meaning);

/// What the driver fills in for each meaning.
struct RegisterFill {
  std::int64_t position = 0;
  bool position_is_signed = true;  ///< as the drive's own count is, RegisterNumber::is_signed
  std::int64_t distance = 0;
  std::int64_t speed = 0;
  std::int64_t acceleration = 0;
  std::int64_t watchdog = 0;
  std::int64_t level = 0;
};

/// The numbers that registers can hold, both ends included.
struct RegisterRange {
  std::int64_t least = 0;
  std::int64_t most = 0;

  [[nodiscard]] bool contains(std::int64_t number) const { return least <= number && number <= most; }
};

/// Of a register value of 16 or 32 bits.
RegisterRange signed_range(int bits);
RegisterRange unsigned_range(int bits);

/// The counts that the drive can both be sent to by the profile's `move` and show as its position.
RegisterRange counter_range(const ModbusProfile& profile);

/// The registers of one write, in the drive's word order. A position is signed or not as `fill` says, a
/// distance always signed, a constant a pattern of bits; the others are never negative.
/// @throws std::out_of_range when a value does not fit its bits.
std::vector<std::uint16_t> encode(const RegisterWrite& write, WordOrder order, const RegisterFill& fill);

/// The number that stands in `registers` (one or two of them).
std::int64_t decode(const RegisterNumber& number, WordOrder order, std::span<const std::uint16_t> registers);

/// Which register dims a lamp.
struct ModbusLampProfile {
  std::string model;
  WordOrder word_order = WordOrder::high_first;
  SerialDefaults serial;
  RegisterWrites connect;
  RegisterWrites set_level;  ///< uses RegisterMeaning::level
  std::int64_t full = 255;   ///< the number that means full brightness

  void check() const;
};

}  // namespace eigenpose
