#include "config/modbus_profile.h"

#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "config/toml_table.h"
#include "core/base/error.h"

namespace eigenpose {

extern const char* const
    builtin_oriental_motor_az;  ///< config/profiles/oriental_motor_az.toml, put in by the build

namespace {

constexpr std::int64_t known_format = 1;
constexpr std::int64_t last_address = 0xFFFF;
constexpr std::int64_t smallest_step = std::numeric_limits<std::int32_t>::min();
constexpr std::int64_t largest_step = std::numeric_limits<std::int32_t>::max();

/// Decimal or 0x…, with or without a minus; the whole text or nothing.
std::optional<std::int64_t> parse_integer(std::string_view text) {
  const bool negative = text.starts_with('-');
  if (negative) text.remove_prefix(1);
  const bool hexadecimal = text.starts_with("0x");
  if (hexadecimal) text.remove_prefix(2);
  std::uint32_t value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, hexadecimal ? 16 : 10);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return {};
  return negative ? -static_cast<std::int64_t>(value) : static_cast<std::int64_t>(value);
}

/// "position:32", "0x10:16", "-1:32".
RegisterValue value_of(const TomlTable& table, const std::string& text) {
  static const std::map<std::string_view, RegisterMeaning> meanings = {
      {"position", RegisterMeaning::position},    {"distance", RegisterMeaning::distance},
      {"speed", RegisterMeaning::speed},          {"acceleration", RegisterMeaning::acceleration},
      {"watchdog_ms", RegisterMeaning::watchdog}, {"level", RegisterMeaning::level}};
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string_view what = std::string_view(text).substr(0, colon);
  const std::string_view bits = std::string_view(text).substr(std::min(colon + 1, text.size()));
  const auto meaning = meanings.find(what);
  const auto constant = parse_integer(what);
  if ((bits != "16" && bits != "32") || (meaning == meanings.end() && !constant))
    table.fail("values",
               fmt::format("\"{}\" must be WHAT:BITS, where BITS is 16 or 32 and WHAT a number or one of "
                           "position, distance, speed, acceleration, watchdog_ms, level",
                           text));
  RegisterValue value;
  value.bits = bits == "32" ? 32 : 16;
  if (meaning != meanings.end()) {
    value.meaning = meaning->second;
    return value;
  }
  const std::int64_t span = std::int64_t{1} << value.bits;
  if (*constant < -span / 2 || *constant >= span)
    table.fail("values", fmt::format("\"{}\": {} does not fit {} bits", text, *constant, value.bits));
  value.constant = *constant;
  return value;
}

std::uint16_t address_of(const TomlTable& table) {
  return static_cast<std::uint16_t>(table.integer("register", {}, 0, last_address));
}

RegisterWrites writes_of(const TomlTable& table, std::string_view key) {
  RegisterWrites writes;
  for (const TomlTable& entry : table.tables(key)) {
    RegisterWrite write;
    write.address = address_of(entry);
    for (const std::string& text : entry.texts("values")) write.values.push_back(value_of(entry, text));
    entry.finish();
    if (write.values.empty()) entry.fail("values", "what is written must be listed");
    writes.push_back(std::move(write));
  }
  return writes;
}

std::optional<StatusBit> bit_of(const TomlTable& table, std::string_view key) {
  const auto entry = table.table(key);
  if (!entry) return {};
  StatusBit bit;
  bit.address = address_of(*entry);
  bit.bit = static_cast<int>(entry->integer("bit", {}, 0, 15));
  bit.active = entry->integer("when", 1, 0, 1) == 1;
  entry->finish();
  return bit;
}

RegisterNumber number_of(const TomlTable& table) {
  RegisterNumber number;
  number.address = address_of(table);
  number.bits = static_cast<int>(table.integer("bits", {}, 16, 32));
  number.is_signed = table.flag("signed", true);
  return number;
}

WordOrder word_order_of(const TomlTable& root) {
  return root.choice("word_order", {}, {"high_first", "low_first"}) == "high_first" ? WordOrder::high_first
                                                                                    : WordOrder::low_first;
}

SerialDefaults serial_of(const TomlTable& root) {
  SerialDefaults serial;
  const auto table = root.table("serial");
  if (!table) return serial;
  serial.baud = static_cast<int>(table->integer("baud", {}, 1200, 4'000'000));
  const std::string parity = table->choice("parity", {}, {"none", "even", "odd"});
  serial.parity = parity == "none" ? 'N' : parity == "even" ? 'E' : 'O';
  serial.stop_bits = static_cast<int>(table->integer("stop_bits", {}, 1, 2));
  serial.silent_interval = std::chrono::milliseconds(table->integer("silent_interval_ms", 0, 0, 1000));
  table->finish();
  return serial;
}

TomlTable needed(const TomlTable& root, std::string_view key) {
  auto table = root.table(key);
  if (!table) root.fail(key, fmt::format("the table [{}] is missing", key));
  return *table;
}

void read_units(const TomlTable& root, ModbusProfile& profile) {
  const TomlTable units = needed(root, "units");
  profile.steps_per_turn = units.number("steps_per_turn", 0.0, 0.0, 1e8);
  profile.speed_unit =
      units.choice("speed", {}, {"steps_per_s", "rpm"}) == "rpm" ? SpeedUnit::rpm : SpeedUnit::steps_per_s;
  profile.acceleration_unit =
      units.choice("acceleration", {}, {"steps_per_s2", "ms_per_1000rpm"}) == "ms_per_1000rpm"
          ? AccelerationUnit::ms_per_1000rpm
          : AccelerationUnit::steps_per_s2;
  units.finish();
}

void read_defaults(const TomlTable& root, ModbusProfile& profile) {
  const auto table = root.table("defaults");
  if (!table) return;
  AxisDefaults& defaults = profile.defaults;
  defaults.steps_per_unit = table->number("steps_per_unit", defaults.steps_per_unit, 1e-3, 1e7);
  defaults.speed = table->number("speed", defaults.speed, 1e-6, 1e6);
  defaults.acceleration = table->number("acceleration", defaults.acceleration, 1e-6, 1e9);
  defaults.arrival_tolerance = table->number("arrival_tolerance", defaults.arrival_tolerance, 0.0, 1e3);
  defaults.watchdog = std::chrono::milliseconds(table->integer("watchdog_ms", 2000, 0, 10'000));
  table->finish();
}

void read_status(const TomlTable& root, ModbusProfile& profile) {
  const TomlTable position = needed(root, "position");
  profile.position = number_of(position);
  if (position.has("home_steps"))
    profile.home_steps = position.integer("home_steps", {}, smallest_step, largest_step);
  position.finish();

  const TomlTable status = needed(root, "status");
  const auto moving = bit_of(status, "moving");
  if (!moving) status.fail("moving", "this bit is missing: without it nobody knows when a move has ended");
  profile.moving = *moving;
  profile.ready = bit_of(status, "ready");
  profile.in_position = bit_of(status, "in_position");
  profile.homed = bit_of(status, "homed");
  profile.alarm = bit_of(status, "alarm");
  status.finish();
}

void read_alarms(const TomlTable& root, ModbusProfile& profile) {
  const auto table = root.table("alarm");
  if (!table) return;
  profile.alarm_code = number_of(*table);
  for (const double code : table->numbers("silence")) {
    if (code < 1 || code != std::floor(code)) table->fail("silence", "a list of alarm codes is needed");
    profile.silence_alarms.push_back(static_cast<std::int64_t>(code));
  }
  for (const auto& [key, words] : table->text_pairs("text")) {
    const auto code = parse_integer(key);
    if (!code || *code == 0) table->fail("text", fmt::format("\"{}\" is not an alarm code", key));
    profile.alarms[*code] = words;
  }
  table->finish();
}

void read_commands(const TomlTable& root, ModbusProfile& profile) {
  const TomlTable table = needed(root, "commands");
  profile.connect = writes_of(table, "connect");
  profile.prepare = writes_of(table, "prepare");
  profile.home = writes_of(table, "home");
  profile.move = writes_of(table, "move");
  profile.jog = writes_of(table, "jog");
  profile.stop = writes_of(table, "stop");
  profile.clear_alarm = writes_of(table, "clear_alarm");
  profile.arm_watchdog = writes_of(table, "arm_watchdog");
  profile.disarm_watchdog = writes_of(table, "disarm_watchdog");
  table.finish();
}

TomlTable open(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file))
    throw FileError(file, "there is no such profile; config/profiles holds those that are shipped");
  return TomlTable::read_file(file);
}

/// What drives and lamps have in common. The other keys are the caller's.
template <class Profile>
void read_head(const TomlTable& root, std::string_view kind, Profile& profile) {
  (void)root.integer("format", {}, known_format, known_format);
  (void)root.choice("kind", {}, {kind});
  profile.model = root.text("model");
  profile.word_order = word_order_of(root);
  profile.serial = serial_of(root);
}

template <class Profile>
void check(const std::string& file, const Profile& profile) {
  try {
    profile.check();
  } catch (const std::invalid_argument& error) {
    throw ConfigError(fmt::format("{}:1: {}", file, error.what()));
  }
}

ModbusProfile read_drive(const TomlTable& root, const std::string& file) {
  ModbusProfile profile;
  read_head(root, "drive", profile);
  read_units(root, profile);
  read_defaults(root, profile);
  read_status(root, profile);
  read_alarms(root, profile);
  read_commands(root, profile);
  root.finish();
  check(file, profile);
  return profile;
}

}  // namespace

ModbusProfile read_modbus_profile(const std::filesystem::path& file) {
  return read_drive(open(file), file.string());
}

ModbusProfile parse_modbus_profile(std::string_view text, const std::string& name) {
  return read_drive(TomlTable::parse(text, name), name);
}

ModbusProfile oriental_motor_az_profile() {
  return parse_modbus_profile(builtin_oriental_motor_az, "built-in profile oriental_motor_az");
}

ModbusLampProfile read_modbus_lamp_profile(const std::filesystem::path& file) {
  ModbusLampProfile profile;
  const TomlTable root = open(file);
  read_head(root, "lamp", profile);
  profile.full = root.integer("full", {}, 1, largest_step);
  const TomlTable commands = needed(root, "commands");
  profile.connect = writes_of(commands, "connect");
  profile.set_level = writes_of(commands, "set_level");
  commands.finish();
  root.finish();
  check(file.string(), profile);
  return profile;
}

}  // namespace eigenpose
