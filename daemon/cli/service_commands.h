#pragma once

/// The commands that talk to a running eigenposed.

#include "daemon/cli/command.h"

namespace eigenpose::cli {

void add_acquire_command(CLI::App& app, CommandLine& line);
void add_results_command(CLI::App& app, CommandLine& line);
void add_status_command(CLI::App& app, CommandLine& line);
void add_objects_command(CLI::App& app, CommandLine& line);
/// Only where the simulated lab is built in.
void add_lab_command(CLI::App& app, CommandLine& line);

}  // namespace eigenpose::cli
