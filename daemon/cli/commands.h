#pragma once

/// Every command of `eigenpose`, one a file.

#include "daemon/cli/command.h"

namespace eigenpose::cli {

void add_evaluate_command(CLI::App& app, CommandLine& line);
void add_import_command(CLI::App& app, CommandLine& line);
void add_inspect_command(CLI::App& app, CommandLine& line);
void add_learn_command(CLI::App& app, CommandLine& line);
void add_recognize_command(CLI::App& app, CommandLine& line);
void add_resample_command(CLI::App& app, CommandLine& line);

}  // namespace eigenpose::cli
