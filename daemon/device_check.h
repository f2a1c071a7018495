#pragma once

/// Devices judged by their configuration alone.

#include "config/config.h"

namespace eigenpose {

/// Everything that `make_devices`, and opening what it returns, would refuse and that can be known without
/// opening a device, a port or a socket: drivers, profiles, stages, options that no driver takes.
/// @throws ConfigError, FileError.
void check_device_options(const Config& config);

}  // namespace eigenpose
