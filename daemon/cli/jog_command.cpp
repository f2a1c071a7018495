/// `eigenpose jog` and `eigenpose home`: one axis by hand.

#include <cstdio>

#include <CLI/CLI.hpp>

#include "core/base/clock.h"
#include "daemon/cli/hardware_commands.h"
#include "daemon/cli/rig_options.h"
#include "daemon/hardware/hand_control.h"

namespace eigenpose::cli {

void add_jog_command(CLI::App& app, CommandLine& line) {
  struct Options {
    RigOptions rig;
    std::string axis;
    double position = 0.0;
    bool relative = false;
    bool home_first = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("jog", "Move one axis by hand, within its limits; Ctrl-C stops it");
  options->rig.add_to(*command);
  command->add_option("AXIS", options->axis, "Its name in the configuration")->required();
  command->add_option("POSITION", options->position, "Where to, in the axis's unit (deg, mm)")->required();
  command->add_flag(
      "--by", options->relative,
      "POSITION counts from where the axis stands; an axis that is not homed moves a little at most");
  command->add_flag("--home", options->home_first, "Home it first");
  command->footer(
      "Examples:\n  eigenpose jog table 90              turn the table to 90 degrees\n"
      "  eigenpose jog light_azimuth -5 --by move the arm back by 5 degrees\n"
      "Limits are those of the configuration. While eigenposed runs it holds the drives: systemctl stop "
      "eigenposed.");
  command->callback([options, &line] {
    line.action = [options, &line] {
      const DevicesInHand in_hand(line);
      const SteadyClock clock;
      HandControl hands(options->rig.read(), clock);
      if (options->home_first) hands.home(options->axis, line.stop);
      const double arrived = options->relative ? hands.jog_by(options->axis, options->position, line.stop)
                                               : hands.jog_to(options->axis, options->position, line.stop);
      std::printf("%s: %.3f %s\n", options->axis.c_str(), arrived, hands.unit_of(options->axis).c_str());
      return static_cast<int>(exit_done);
    };
  });
}

void add_home_command(CLI::App& app, CommandLine& line) {
  struct Options {
    RigOptions rig;
    std::vector<std::string> axes;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("home", "Home axes, one after the other; Ctrl-C stops the one that moves");
  options->rig.add_to(*command);
  command->add_option("AXIS", options->axes, "Names in the configuration; none: all of them");
  command->footer(
      "Examples:\n  eigenpose home          every axis\n  eigenpose home table    the turntable alone\n"
      "Keep a hand on the emergency stop the first time. While eigenposed runs it holds the drives:\n"
      "systemctl stop eigenposed.");
  command->callback([options, &line] {
    line.action = [options, &line] {
      const DevicesInHand in_hand(line);
      const SteadyClock clock;
      HandControl hands(options->rig.read(), clock);
      for (const std::string& axis : options->axes.empty() ? hands.axis_names() : options->axes) {
        hands.home(axis, line.stop);
        std::printf("%s: homed, at %.3f %s\n", axis.c_str(), hands.state(axis).position,
                    hands.unit_of(axis).c_str());
        std::fflush(stdout);
      }
      return static_cast<int>(exit_done);
    };
  });
}

}  // namespace eigenpose::cli
