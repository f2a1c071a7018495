/// `eigenpose doctor`: checks everything the configuration needs, and names what to do for each fault.

#include <cstdio>
#include <set>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "core/base/error.h"
#include "core/base/printable.h"
#include "daemon/cli/hardware_commands.h"
#include "daemon/cli/rig_options.h"
#include "daemon/hardware/checkup.h"

namespace eigenpose::cli {
namespace {

const char* health_name(Health health) {
  switch (health) {
    case Health::good:
      return "ok";
    case Health::note:
      return "note";
    case Health::fault:
      return "fault";
  }
  return "";
}

class Doctor {
 public:
  explicit Doctor(bool json) : json_(json) {}

  void report(const Finding& finding) {
    if (finding.health == Health::fault) {
      ++faults_;
      faulty_.insert(finding.subject);
    }
    if (finding.health == Health::note) ++notes_;
    if (json_) {
      findings_.push_back({{"health", health_name(finding.health)},
                           {"subject", finding.subject},
                           {"what", finding.what},
                           {"remedy", finding.remedy}});
      return;
    }
    std::printf("%-6s %s: %s\n", health_name(finding.health), printable(finding.subject).c_str(),
                printable(finding.what).c_str());
    if (!finding.remedy.empty()) std::printf("       -> %s\n", finding.remedy.c_str());
    std::fflush(stdout);
  }

  [[nodiscard]] bool has_faulted(const std::string& subject) const { return faulty_.contains(subject); }

  int finish() {
    if (json_) {
      std::printf("%s\n", findings_.dump(2).c_str());
    } else {
      std::printf("%d fault%s, %d note%s\n", faults_, faults_ == 1 ? "" : "s", notes_,
                  notes_ == 1 ? "" : "s");
    }
    return faults_ == 0 ? exit_done : exit_failed;
  }

 private:
  bool json_;
  int faults_ = 0;
  int notes_ = 0;
  std::set<std::string> faulty_;  ///< subjects
  nlohmann::json findings_ = nlohmann::json::array();
};

int examine(const RigOptions& rig, bool json, const std::stop_token& stop) {
  Doctor doctor(json);
  const auto report = [&doctor](const Finding& finding) { doctor.report(finding); };
  Config config;
  try {
    config = rig.read();
  } catch (const ConfigError& error) {
    report({Health::fault, "configuration", error.what(),
            std::filesystem::exists(rig.config)
                ? "'eigenposed --check-config --config FILE' says when it is good"
                : "copy the nearest file of config/rigs there and adapt it, or name yours: --config FILE"});
    check_found({}, take_inventory(), report);
    return doctor.finish();
  }
  report({Health::good, "configuration", config.file.string() + " is good", {}});
  check_machine({}, config, take_inventory(), report);
  if (is_service_running(config)) {
    report({Health::note, "service", "eigenposed is running and holds the devices, so they were not asked",
            "'eigenpose status' shows them; to ask the devices, run systemctl stop eigenposed first"});
    return doctor.finish();
  }
  const SteadyClock clock;
  try {
    Devices devices = make_devices(config, clock);
    // A device that is not there or may not be opened has been reported already.
    std::erase_if(devices.axes,
                  [&](const RigAxis& axis) { return doctor.has_faulted("axis " + axis.options.dof.name); });
    std::erase_if(devices.lamps,
                  [&](const RigLamp& lamp) { return doctor.has_faulted("lamp " + lamp.options.name); });
    if (doctor.has_faulted("camera")) devices.camera = nullptr;
    check_devices(devices, clock, stop, report);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    report({Health::fault, "devices", error.what(), "change the configuration"});
  }
  return doctor.finish();
}

}  // namespace

void add_doctor_command(CLI::App& app, CommandLine& line) {
  struct Options {
    RigOptions rig;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "doctor",
      "Check cameras, permissions, ports and drives, and say what to do for each fault; moves nothing");
  options->rig.add_to(*command);
  command->add_flag("--json", options->json, "Print the findings as JSON");
  command->footer(
      "Exit code 1 if there is any fault. While eigenposed runs, it holds the devices; then they are not "
      "asked.");
  command->callback([options, &line] {
    line.action = [options, &line] { return examine(options->rig, options->json, line.stop); };
  });
}

}  // namespace eigenpose::cli
