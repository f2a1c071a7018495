// Reading Modbus device profiles.

#include "config/modbus_profile.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;

const std::filesystem::path profiles = std::filesystem::path(EIGENPOSE_SOURCE_DIR) / "config" / "profiles";

/// The smallest drive that can be used; each test spoils one thing.
const std::string smallest = R"(format = 1
kind = "drive"
model = "Test drive"
word_order = "high_first"
[units]
speed = "steps_per_s"
acceleration = "steps_per_s2"
[position]
register = 0x10
bits = 32
[status]
moving = { register = 0x20, bit = 1 }
[alarm]
register = 0x30
bits = 16
[commands]
home = [{ register = 1, values = ["1:16"] }]
move = [{ register = 2, values = ["position:32"] }]
stop = [{ register = 1, values = ["2:16"] }]
)";

std::string with(const std::string& old, const std::string& replacement) {
  std::string text = smallest;
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return text.replace(at, old.size(), replacement);
}

std::string complaint(const std::string& text) {
  try {
    (void)parse_modbus_profile(text, "drive.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no complaint";
}

TEST(ModbusProfile, EveryShippedDriveProfileCanBeRead) {
  int drives = 0;
  for (const auto& entry : std::filesystem::directory_iterator(profiles)) {
    if (entry.path().extension() != ".toml") continue;
    std::ifstream file(entry.path());
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (text.find("kind = \"lamp\"") != std::string::npos) {
      EXPECT_NO_THROW((void)read_modbus_lamp_profile(entry.path())) << entry.path();
    } else {
      EXPECT_NO_THROW((void)read_modbus_profile(entry.path())) << entry.path();
      ++drives;
    }
  }
  EXPECT_GE(drives, 1);
}

TEST(ModbusProfile, OrientalMotorMovesByDirectDataOperation) {
  const ModbusProfile profile = read_modbus_profile(profiles / "oriental_motor_az.toml");
  ASSERT_EQ(profile.move.size(), 1U);
  EXPECT_EQ(profile.move[0].address, 0x0058);
  RegisterFill fill;
  fill.position = -2;
  fill.speed = 3000;
  fill.acceleration = 70000;
  const auto registers = encode(profile.move[0], profile.word_order, fill);
  EXPECT_THAT(registers,
              testing::ElementsAre(0, 0, 0, 1, 0xFFFF, 0xFFFE, 0, 3000, 1, 4464, 1, 4464, 0, 1000, 0, 1));
}

TEST(ModbusProfile, TheBuiltInProfileIsTheShippedFile) {
  const ModbusProfile shipped = read_modbus_profile(profiles / "oriental_motor_az.toml");
  const ModbusProfile built_in = oriental_motor_az_profile();
  EXPECT_EQ(built_in.model, shipped.model);
  EXPECT_EQ(built_in.alarms, shipped.alarms);
  EXPECT_EQ(built_in.position.address, shipped.position.address);
}

TEST(ModbusProfile, SaysAlarmsInWords) {
  const ModbusProfile profile = oriental_motor_az_profile();
  EXPECT_THAT(profile.describe_alarm(0x30), HasSubstr("overload"));
  EXPECT_THAT(profile.describe_alarm(0x99), HasSubstr("0x99"));
  EXPECT_TRUE(profile.is_silence_alarm(0x85));
  EXPECT_FALSE(profile.is_silence_alarm(0x30));
}

TEST(ModbusProfile, AMissingFileIsNamed) {
  EXPECT_THROW((void)read_modbus_profile("/nowhere/drive.toml"), FileError);
}

TEST(ModbusProfile, TheSmallestDriveIsAccepted) {
  EXPECT_NO_THROW((void)parse_modbus_profile(smallest, "drive.toml"));
}

TEST(ModbusProfile, AnUnknownKeyIsRefusedWithFileAndLine) {
  EXPECT_THAT(complaint(with("bits = 32\n", "bits = 32\nsinged = true\n")), HasSubstr("drive.toml:11: "));
  EXPECT_THAT(complaint(with("bits = 32\n", "bits = 32\nsinged = true\n")), HasSubstr("signed"));
  EXPECT_THAT(complaint(with("bit = 1 }", "bit = 1, wenn = 0 }")), HasSubstr("wenn"));
  EXPECT_THAT(complaint(smallest + "stopp = []\n"), HasSubstr("stopp"));
}

TEST(ModbusProfile, ImpossibleValuesAreRefused) {
  EXPECT_THAT(complaint(with("format = 1", "format = 2")), HasSubstr("drive.toml:1: "));
  EXPECT_THAT(complaint(with("kind = \"drive\"", "kind = \"lamp\"")), HasSubstr("drive.toml:2: "));
  EXPECT_THAT(complaint(with("bits = 32", "bits = 24")), HasSubstr("24"));
  EXPECT_THAT(complaint(with("register = 0x20", "register = 65536")), HasSubstr("65536"));
  for (const char* bit : {"-1", "16", "31"})
    EXPECT_THAT(complaint(with("bit = 1 }", "bit = " + std::string(bit) + " }")), HasSubstr("0 to 15"))
        << bit;
  for (const char* bit : {"0", "15"})
    EXPECT_EQ(complaint(with("bit = 1 }", "bit = " + std::string(bit) + " }")), "no complaint") << bit;
  EXPECT_THAT(complaint(with("bit = 1 }", "bit = 1, when = 2 }")), HasSubstr("0 to 1"));
  EXPECT_THAT(complaint(with("\"position:32\"", "\"position:24\"")), HasSubstr("position:24"));
  EXPECT_THAT(complaint(with("\"position:32\"", "\"positron:32\"")), HasSubstr("positron"));
  EXPECT_THAT(complaint(with("\"1:16\"", "\"65536:16\"")), HasSubstr("65536"));
  EXPECT_THAT(complaint(with("\"1:16\"", "\"1\"")), HasSubstr("WHAT:BITS"));
}

TEST(ModbusProfile, EveryNumberIsTakenUpToBothItsBoundsAndNotBeyond) {
  const auto with_line = [](const std::string& table, const std::string& line) {
    return with("[position]\n", table + line + "[position]\n");
  };
  const std::string serial = "[serial]\nparity = \"even\"\n";
  struct Bounds {
    std::string table, key, lower, upper, below, above;
  };
  for (const Bounds& b : std::vector<Bounds>{
           {serial + "stop_bits = 1\n", "baud", "1200", "4000000", "1199", "4000001"},
           {serial + "baud = 9600\n", "stop_bits", "1", "2", "0", "3"},
           {serial + "baud = 9600\nstop_bits = 1\n", "silent_interval_ms", "0", "1000", "-1", "1001"},
           {"[defaults]\n", "steps_per_unit", "0.001", "1e7", "0.0009", "1.1e7"},
           {"[defaults]\n", "speed", "1e-6", "1e6", "9e-7", "1.1e6"},
           {"[defaults]\n", "acceleration", "1e-6", "1e9", "9e-7", "1.1e9"},
           {"[defaults]\n", "arrival_tolerance", "0.0", "1e3", "-0.001", "1000.1"},
           {"[defaults]\n", "watchdog_ms", "0", "10000", "-1", "10001"}}) {
    EXPECT_EQ(complaint(with_line(b.table, b.key + " = " + b.lower + "\n")), "no complaint") << b.key;
    EXPECT_EQ(complaint(with_line(b.table, b.key + " = " + b.upper + "\n")), "no complaint") << b.key;
    EXPECT_THAT(complaint(with_line(b.table, b.key + " = " + b.below + "\n")), HasSubstr(b.key)) << "below";
    EXPECT_THAT(complaint(with_line(b.table, b.key + " = " + b.above + "\n")), HasSubstr(b.key)) << "above";
  }
  EXPECT_THAT(complaint(with("bits = 32\n", "bits = 32\nhome_steps = 2147483648\n")),
              HasSubstr("home_steps"));
  EXPECT_EQ(complaint(with("bits = 32\n", "bits = 32\nhome_steps = -2147483648\n")), "no complaint");
}

TEST(ModbusProfile, WhatIsLeftOutIsAsForEveryDrive) {
  const auto read = [](const std::string& tables) {
    return parse_modbus_profile(with("[position]\n", tables + "[position]\n"), "drive.toml");
  };
  const AxisDefaults usual;
  // Each table with one key alone: the others keep their defaults, and so does a profile without the table.
  for (const std::string key :
       {"", "steps_per_unit", "speed", "acceleration", "arrival_tolerance", "watchdog_ms"}) {
    const AxisDefaults defaults = read(key.empty() ? "" : "[defaults]\n" + key + " = 7\n").defaults;
    EXPECT_EQ(defaults.steps_per_unit, key == "steps_per_unit" ? 7.0 : usual.steps_per_unit) << key;
    EXPECT_EQ(defaults.speed, key == "speed" ? 7.0 : usual.speed) << key;
    EXPECT_EQ(defaults.acceleration, key == "acceleration" ? 7.0 : usual.acceleration) << key;
    EXPECT_EQ(defaults.arrival_tolerance, key == "arrival_tolerance" ? 7.0 : usual.arrival_tolerance) << key;
    EXPECT_EQ(defaults.watchdog,
              key == "watchdog_ms" ? Duration(std::chrono::milliseconds(7)) : usual.watchdog)
        << key;
  }
  EXPECT_GT(usual.watchdog, Duration{}) << "a drive left alone stops by itself";
  const ModbusProfile plain = read("");
  EXPECT_TRUE(plain.position.is_signed);
  EXPECT_TRUE(plain.moving.active) << "a status bit says what it is called when it is set";
  EXPECT_EQ(plain.serial.silent_interval, Duration{});
  const ModbusProfile serial = read("[serial]\nbaud = 9600\nparity = \"odd\"\nstop_bits = 2\n");
  EXPECT_EQ(serial.serial.baud, 9600);
  EXPECT_EQ(serial.serial.parity, 'O');
  EXPECT_EQ(serial.serial.stop_bits, 2);
  EXPECT_EQ(serial.serial.silent_interval, Duration{});
}

TEST(ModbusProfile, WhatWouldBeDangerousIsRefused) {
  EXPECT_THAT(complaint(with("stop = [{ register = 1, values = [\"2:16\"] }]", "")),
              HasSubstr("no stop command"));
  EXPECT_THAT(complaint(with("\"position:32\"", "\"5:32\"")), HasSubstr("writes no position"));
  EXPECT_THAT(complaint(with("[alarm]\nregister = 0x30\nbits = 16\n", "")), HasSubstr("alarm"));
  EXPECT_THAT(complaint(with("moving = { register = 0x20, bit = 1 }", "")), HasSubstr("moving"));
  EXPECT_THAT(complaint(smallest + "arm_watchdog = [{ register = 9, values = [\"watchdog_ms:16\"] }]\n"),
              HasSubstr("never disarmed"));
  EXPECT_THAT(complaint(with("speed = \"steps_per_s\"", "speed = \"rpm\"")), HasSubstr("steps_per_turn"));
}

TEST(ModbusRegisters, BothWordOrdersComeBackAsWritten) {
  for (const WordOrder order : {WordOrder::high_first, WordOrder::low_first}) {
    for (const std::int64_t value : {0LL, 1LL, -1LL, 65535LL, 65536LL, -2147483648LL, 2147483647LL}) {
      RegisterFill fill;
      fill.position = value;
      const RegisterWrite write{7, {{RegisterMeaning::position, 0, 32}}};
      EXPECT_EQ(decode({7, 32, true}, order, encode(write, order, fill)), value);
    }
  }
  EXPECT_EQ(decode({0, 32, true}, WordOrder::low_first, std::vector<std::uint16_t>{1, 2}), 0x20001);
  EXPECT_EQ(decode({0, 16, true}, WordOrder::high_first, std::vector<std::uint16_t>{0xFFFF}), -1);
  EXPECT_EQ(decode({0, 16, false}, WordOrder::high_first, std::vector<std::uint16_t>{0xFFFF}), 65535);
}

TEST(ModbusRegisters, ANumberThatDoesNotFitIsNotCutOff) {
  RegisterFill fill;
  fill.speed = 65536;
  EXPECT_THROW((void)encode({1, {{RegisterMeaning::speed, 0, 16}}}, WordOrder::high_first, fill),
               std::out_of_range);
  fill.speed = -32769;
  EXPECT_THROW((void)encode({1, {{RegisterMeaning::speed, 0, 16}}}, WordOrder::high_first, fill),
               std::out_of_range);
}

/// Whether a register value of that many bits can hold `number`.
bool fits(RegisterMeaning meaning, int bits, std::int64_t number, bool position_is_signed = true) {
  RegisterFill fill;
  fill.position_is_signed = position_is_signed;
  fill.position = fill.distance = fill.speed = fill.acceleration = fill.watchdog = fill.level = number;
  try {
    (void)encode({1, {{meaning, number, bits}}}, WordOrder::high_first, fill);
    return true;
  } catch (const std::out_of_range&) {
    return false;
  }
}

TEST(ModbusRegisters, EachMeaningHasTheRangeOfItsOwnSign) {
  for (const int bits : {16, 32}) {
    const std::int64_t span = std::int64_t{1} << bits;
    for (const RegisterMeaning meaning : {RegisterMeaning::position, RegisterMeaning::distance}) {
      EXPECT_TRUE(fits(meaning, bits, -span / 2) && fits(meaning, bits, span / 2 - 1)) << bits;
      EXPECT_FALSE(fits(meaning, bits, -span / 2 - 1) || fits(meaning, bits, span / 2)) << bits;
    }
    EXPECT_TRUE(fits(RegisterMeaning::position, bits, span - 1, false));
    EXPECT_FALSE(fits(RegisterMeaning::position, bits, -1, false) ||
                 fits(RegisterMeaning::position, bits, span, false));
    EXPECT_FALSE(fits(RegisterMeaning::distance, bits, span / 2, false)) << "a distance has a sign always";
    for (const RegisterMeaning meaning : {RegisterMeaning::speed, RegisterMeaning::acceleration,
                                          RegisterMeaning::watchdog, RegisterMeaning::level}) {
      EXPECT_TRUE(fits(meaning, bits, 0) && fits(meaning, bits, span - 1)) << bits;
      EXPECT_FALSE(fits(meaning, bits, -1) || fits(meaning, bits, span)) << bits;
    }
    EXPECT_TRUE(fits(RegisterMeaning::constant, bits, -span / 2) &&
                fits(RegisterMeaning::constant, bits, span - 1));
    EXPECT_FALSE(fits(RegisterMeaning::constant, bits, -span / 2 - 1) ||
                 fits(RegisterMeaning::constant, bits, span));
  }
}

TEST(ModbusRegisters, TheCounterEndsWhereTheNarrowerOfTargetAndPositionEnds) {
  ModbusProfile profile;
  profile.move = {{1, {{RegisterMeaning::constant, 7, 16}, {RegisterMeaning::position, 0, 16}}}};
  EXPECT_EQ(counter_range(profile).least, -32768);
  EXPECT_EQ(counter_range(profile).most, 32767);
  profile.position.is_signed = false;
  EXPECT_EQ(counter_range(profile).least, 0);
  EXPECT_EQ(counter_range(profile).most, 65535);
  profile.move = {{1, {{RegisterMeaning::position, 0, 32}}}};
  EXPECT_EQ(counter_range(profile).most, 4294967295);
  profile.position.bits = 16;
  EXPECT_EQ(counter_range(profile).most, 65535);
}

}  // namespace
}  // namespace eigenpose
