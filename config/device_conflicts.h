#pragma once

/// Two entries of a configuration that drive one device.

#include "config/config.h"
#include "config/toml_table.h"

namespace eigenpose {

/// Refuses the second of two entries that drive one device, however each spells it: two axes on one drive, an
/// axis and a lamp on one USB device or one Modbus station, two lamps on one output. Nothing is opened and no
/// name is looked up, so two names of one host are not known for one here; the drivers find that out.
/// @param root the file that `config` was read from. @throws ConfigError with its line.
void refuse_device_conflicts(const TomlTable& root, const Config& config);

}  // namespace eigenpose
