/// `eigenpose lab`: the hands of a person in the simulated lab.

#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "daemon/cli/service_client.h"
#include "daemon/cli/service_commands.h"
#include "sim/lab/lab_client.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

constexpr const char* lab_examples = R"(
What stands on the table is known to the lab alone: the service has to see it.

Examples:
  eigenpose lab list                       what can be placed
  eigenpose lab place duck --yaw 30        put it on the table, at once
  eigenpose lab place mug --hand           the same by a hand that comes and goes
  eigenpose lab truth                      what stands there, and how it is turned
  eigenpose lab clear                      empty the table
  eigenpose lab fault camera --stalled     break something; without options it is repaired
  eigenpose lab fault wire silence -n 3    the next three Modbus requests get no answer)";

struct LabOptions {
  ServiceOptions service;
  std::string object;
  double yaw_deg = 0.0;
  double x_mm = 0.0;
  double y_mm = 0.0;
  bool by_hand = false;
  std::uint64_t id = 0;
  std::string hand;
  double level = 1.0;
  sim::CameraFaults camera;
  int unit = 1;
  bool stuck = false;
  bool dead = false;
  double slip_steps = 0.0;
  double backlash_deg = 0.0;
  std::string wire_fault;
  int times = 1;
  int delay_ms = 300;
};

sim::LabClient connected(const LabOptions& options) {
  // The lab's socket stands beside the service's two.
  const std::filesystem::path named = options.service.socket;
  if (named.filename() == "results.sock" || named.filename() == "control.sock") {
    return sim::LabClient(named.parent_path() / "lab.sock");
  }
  return sim::LabClient(named.extension() == ".sock" ? named : named / "lab.sock");
}

int list(const LabOptions& options) {
  sim::LabClient lab = connected(options);
  if (options.service.json) {
    std::printf("%s\n", lab.request(R"({"do": "objects"})").c_str());
    return exit_done;
  }
  for (const sim::CatalogEntry& entry : lab.objects()) {
    std::printf("%-14s%s%s%s\n", entry.name.c_str(), entry.symmetric ? " looks the same at every angle" : "",
                entry.held_out ? " held out: not to be learned" : "",
                entry.recorded ? " recorded photographs" : "");
  }
  return exit_done;
}

int truth(const LabOptions& options) {
  sim::LabClient lab = connected(options);
  if (options.service.json) {
    std::printf("%s\n", lab.request(R"({"do": "truth"})").c_str());
    return exit_done;
  }
  const sim::Truth now = lab.truth();
  std::printf("table %.2f deg, light azimuth %.2f deg, elevation %.2f deg, lamp %.0f %%%s%s\n",
              now.table.degrees(), now.arm_azimuth.degrees(), now.arm_elevation.degrees(),
              100.0 * now.lamp_level, now.moving ? ", moving" : "",
              now.hand_in_view ? ", a hand in the picture" : "");
  if (now.objects.empty()) std::printf("the table is empty\n");
  for (const sim::TrueObject& object : now.objects) {
    std::printf("%-4llu %-14s pose %7.2f deg, at x %.1f mm, y %.1f mm%s%s\n",
                static_cast<unsigned long long>(object.id), object.name.c_str(), object.angle.degrees(),
                object.x_mm, object.y_mm, object.symmetric ? ", symmetric" : "",
                object.carried ? ", carried by the hand" : "");
  }
  return exit_done;
}

int place(const LabOptions& options) {
  const auto id = connected(options).place(options.object, degrees(options.yaw_deg), options.x_mm,
                                           options.y_mm, options.by_hand);
  std::printf(options.service.json ? "{\"id\":%llu}\n" : "placed as %llu\n",
              static_cast<unsigned long long>(id));
  return exit_done;
}

int fault_drive(const LabOptions& options) {
  connected(options).request(json{
      {"do", "drive_faults"},
      {"unit", options.unit},
      {"stuck", options.stuck},
      {"dead", options.dead},
      {"slip_steps", options.slip_steps},
      {"backlash_deg",
       options.backlash_deg}}.dump());
  return exit_done;
}

int fault_wire(const LabOptions& options) {
  connected(options).request(json{
      {"do", "wire_fault"},
      {"kind", options.wire_fault},
      {"times", options.times},
      {"delay_ms",
       options.delay_ms}}.dump());
  return exit_done;
}

/// Adds a subcommand whose action is `run(options)`.
template <class Run>
CLI::App* add(CLI::App& parent, const char* name, const char* what,
              const std::shared_ptr<LabOptions>& options, CommandLine& line, Run run) {
  CLI::App* command = parent.add_subcommand(name, what);
  add_service_options(*command, options->service);
  command->callback([options, &line, run] { line.action = [options, run] { return run(*options); }; });
  return command;
}

void add_faults(CLI::App& lab, const std::shared_ptr<LabOptions>& options, CommandLine& line) {
  CLI::App* fault = lab.add_subcommand("fault", "Break something, or repair it");
  fault->require_subcommand(1);
  CLI::App* camera = add(*fault, "camera", "Faults of the camera; those not named are ended", options, line,
                         [](const LabOptions& chosen) {
                           connected(chosen).set_camera_faults(chosen.camera);
                           return int{exit_done};
                         });
  camera->add_flag("--stalled", options->camera.stalled, "no frame comes");
  camera->add_flag("--lost", options->camera.lost, "gone, as if unplugged");
  camera->add_option("--noise", options->camera.extra_noise, "standard deviation added, grey levels of 255");
  camera->add_option("--damaged", options->camera.damaged_fraction,
                     "share of frames that are damaged, 0 ... 1");
  CLI::App* drive =
      add(*fault, "drive", "Faults of a drive; those not named are ended", options, line, fault_drive);
  drive->add_option("--unit", options->unit, "Modbus unit: 1 table, 2 light azimuth, 3 light elevation")
      ->capture_default_str();
  drive->add_flag("--stuck", options->stuck, "the motor does not follow");
  drive->add_flag("--dead", options->dead, "no power");
  drive->add_option("--slip", options->slip_steps, "steps that the next move ends short");
  drive->add_option("--backlash", options->backlash_deg, "play between motor and load, degrees");
  CLI::App* wire = add(*fault, "wire", "What the next Modbus requests meet", options, line, fault_wire);
  wire->add_option(
          "kind", options->wire_fault,
          "silence, loss, late, partial, wrong_unit, wrong_transaction, exception, close_connection or death")
      ->required();
  wire->add_option("-n,--times", options->times, "how many requests")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000));
  wire->add_option("--delay-ms", options->delay_ms, "of a late answer")->capture_default_str();
}

}  // namespace

void add_lab_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<LabOptions>();
  CLI::App* lab = app.add_subcommand("lab", "The simulated lab: place objects, know the truth, break things");
  lab->require_subcommand(1);

  add(*lab, "list", "What can be placed", options, line, list);
  add(*lab, "truth", "What stands on the table, and how it is turned", options, line, truth);
  CLI::App* placing = add(*lab, "place", "Put an object on the table", options, line, place);
  placing->add_option("object", options->object, "its name, see 'eigenpose lab list'")->required();
  placing->add_option("--yaw", options->yaw_deg,
                      "how it is turned on the table, degrees, counter-clockwise from above");
  placing->add_option("--x", options->x_mm, "from the table's axis to the right, mm");
  placing->add_option("--y", options->y_mm, "from the table's axis away from the camera, mm");
  placing->add_flag("--hand", options->by_hand, "a hand brings it");
  CLI::App* removing =
      add(*lab, "remove", "Take one object away", options, line, [](const LabOptions& chosen) {
        connected(chosen).remove(chosen.id, chosen.by_hand);
        return int{exit_done};
      });
  removing->add_option("id", options->id, "as 'place' and 'truth' say it")->required();
  removing->add_flag("--hand", options->by_hand, "a hand takes it");
  add(*lab, "clear", "Empty the table", options, line, [](const LabOptions& chosen) {
    connected(chosen).clear();
    return int{exit_done};
  });
  CLI::App* hand = add(*lab, "hand", "Hold a hand into the picture, or take it out", options, line,
                       [](const LabOptions& chosen) {
                         connected(chosen).hand(chosen.hand == "in");
                         return int{exit_done};
                       });
  hand->add_option("where", options->hand, "in or out")->required()->check(CLI::IsMember({"in", "out"}));
  CLI::App* lamp = add(*lab, "lamp", "Set the lamp's level", options, line, [](const LabOptions& chosen) {
    connected(chosen).set_lamp_level(chosen.level);
    return int{exit_done};
  });
  lamp->add_option("level", options->level, "0 dark ... 1 full")->required();
  add_faults(*lab, options, line);
  lab->footer(lab_examples);  // last: the commands above would take it over
}

}  // namespace eigenpose::cli
