#pragma once

/// How a command hangs on the program `eigenpose`.
///
/// A command is one file `<command>_command.cpp` with one function `add_<command>_command`, entered in the
/// table of main.cpp. The function adds a subcommand with its options and a help text with examples, and has
/// the subcommand's callback set `CommandLine::action`. The action runs after the whole line has been
/// understood.

#include <atomic>
#include <functional>
#include <stop_token>

#include "core/base/error.h"

namespace CLI {
class App;
}

namespace eigenpose::cli {

/// What the program returns to the shell.
enum ExitCode : int {
  exit_done = 0,           ///< all went well
  exit_failed = 1,         ///< something a person can do something about; one line on stderr says what
  exit_usage = 2,          ///< the command line cannot be obeyed; one line on stderr says why
  exit_interrupted = 130,  ///< stopped by Ctrl-C, SIGTERM or a closed terminal, everything left tidy
};

/// Options that do not go together, found only when the command runs. Ends with exit_usage.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// What the line asks for.
struct CommandLine {
  /// Does the work and returns the exit code. Failures leave as exceptions; main turns them into one line on
  /// stderr.
  std::function<int()> action;
  /// Requested by Ctrl-C, SIGTERM and a closed terminal. Long work looks at it; a second signal ends the
  /// program at once, unless devices are in its hands.
  std::stop_token stop;
  /// How many DevicesInHand there are. Read by the thread that takes the signals.
  std::atomic<int> devices_in_hand{0};
};

/// While it lives, no signal ends the program before motors have been told to stop and lamps are dark: a
/// command that moves or lights anything makes one before it opens a device. Each call of a device has a
/// deadline, so the program ends soon after the first signal all the same.
class DevicesInHand {
 public:
  /// @param line outlives it.
  explicit DevicesInHand(CommandLine& line) : line_(line) { ++line_.devices_in_hand; }
  DevicesInHand(const DevicesInHand&) = delete;
  DevicesInHand& operator=(const DevicesInHand&) = delete;
  ~DevicesInHand() { --line_.devices_in_hand; }

 private:
  CommandLine& line_;
};

/// A row of the table in main.cpp.
using AddCommand = void (*)(CLI::App& app, CommandLine& line);

}  // namespace eigenpose::cli
