#pragma once

/// What makes a start fail, found before the start: the configuration against this program and this machine.

#include "config/config.h"

namespace eigenpose {

/// Checks everything that can be known without opening a device, a port or a socket. The service runs it
/// before its start, and `eigenposed --check-config` alone.
/// @throws ConfigError, FileError saying what to change.
void check_config(const Config& config);

}  // namespace eigenpose
