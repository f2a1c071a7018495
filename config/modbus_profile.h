#pragma once

/// Reads the profile of a Modbus device from its file. config/profiles/README.md says how to write one.

#include <filesystem>
#include <string>
#include <string_view>

#include "drivers/modbus/profile.h"

namespace eigenpose {

/// A drive. @throws FileError when the file cannot be read; ConfigError "FILE:LINE: what: what to do" on bad
/// TOML, an unknown or missing key, or a value that cannot be.
ModbusProfile read_modbus_profile(const std::filesystem::path& file);

/// The same from text. @param name stands for the file in messages.
ModbusProfile parse_modbus_profile(std::string_view text, const std::string& name);

/// What an axis without a profile in the rig file gets: config/profiles/oriental_motor_az.toml as it was at
/// build time.
ModbusProfile oriental_motor_az_profile();

/// A lamp dimmer. Throws like `read_modbus_profile`.
ModbusLampProfile read_modbus_lamp_profile(const std::filesystem::path& file);

}  // namespace eigenpose
