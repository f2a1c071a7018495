#pragma once

/// The commands that touch the devices themselves, with the service stopped.

#include "daemon/cli/command.h"

namespace eigenpose::cli {

void add_doctor_command(CLI::App& app, CommandLine& line);
void add_devices_command(CLI::App& app, CommandLine& line);
void add_jog_command(CLI::App& app, CommandLine& line);
void add_home_command(CLI::App& app, CommandLine& line);
void add_lamp_command(CLI::App& app, CommandLine& line);

}  // namespace eigenpose::cli
