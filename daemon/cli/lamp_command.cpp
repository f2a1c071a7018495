/// `eigenpose lamp`: one lamp by hand.

#include <cstdio>
#include <optional>

#include <CLI/CLI.hpp>

#include "core/base/clock.h"
#include "daemon/cli/hardware_commands.h"
#include "daemon/cli/rig_options.h"
#include "daemon/hardware/hand_control.h"

namespace eigenpose::cli {

void add_lamp_command(CLI::App& app, CommandLine& line) {
  struct Options {
    RigOptions rig;
    std::string lamp;
    double level = 0.0;
    std::optional<double> seconds;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("lamp", "Light one lamp by hand; it goes dark when the command ends");
  options->rig.add_to(*command);
  command->add_option("LAMP", options->lamp, "Its name in the configuration")->required();
  command->add_option("LEVEL", options->level, "0 (dark) to 1 (full)")->required();
  command->add_option("--for", options->seconds, "How long; without it until Ctrl-C")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.0, 86400.0));
  command->footer(
      "Examples:\n  eigenpose lamp key 0.5           half bright until Ctrl-C\n"
      "  eigenpose lamp key 1 --for 10    full for ten seconds\n"
      "While eigenposed runs it holds the lamps: systemctl stop eigenposed.");
  command->callback([options, &line] {
    line.action = [options, &line] {
      const DevicesInHand in_hand(line);
      const SteadyClock clock;
      HandControl hands(options->rig.read(), clock);
      hands.light(options->lamp, options->level);
      std::printf("%s: %g%s\n", options->lamp.c_str(), options->level,
                  options->seconds ? "" : "; Ctrl-C makes it dark");
      std::fflush(stdout);
      // A day is "until Ctrl-C" for a lamp that a person holds.
      clock.sleep_for(std::chrono::duration_cast<Duration>(
                          std::chrono::duration<double>(options->seconds.value_or(86400.0))),
                      line.stop);
      return static_cast<int>(exit_done);
    };
  });
}

}  // namespace eigenpose::cli
