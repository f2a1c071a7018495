/// `eigenpose import`: photographs taken elsewhere become image sets.

#include <charconv>
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/dataset/coil_import.h"
#include "core/dataset/turned_import.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"

namespace eigenpose::cli {
namespace {

constexpr const char* coil_examples = R"(
The pictures are named OBJECT__NUMBER.png. Each object becomes an image set SETS/OBJECT.
  --angle index:5    the number counts pictures, 5 degrees apart (COIL-20)
  --angle degrees    the number is the angle (COIL-100)

Examples:
  eigenpose import coil coil-20-proc --to sets/coil-20 --angle index:5
  eigenpose import coil coil-100 --to sets/coil-100 --angle degrees

Views that show the object from edge to edge are taken whole later on, others are segmented. Which it is, is measured
over the whole folder and kept in each set.json; --views overrules it.)";

constexpr const char* turned_examples = R"(
Parts that lie flat under a camera look the same wherever they lie, but for how they are turned: one picture of each
is enough. Every part in the picture becomes an image set, turned around once; its pose is by how many degrees it lies
turned, counter-clockwise, from how it lies in the picture. What touches the picture's border is left out.

Examples:
  eigenpose import turned parts.png --to sets --names bracket,plate
  eigenpose learn sets --to parts.model --grey
  eigenpose recognize tray.png --model parts.model)";

struct CoilOptions {
  std::string folder;
  std::string to;
  std::string angle;
  std::string views = "auto";
};

struct TurnedOptions {
  std::string picture;
  std::string to;
  TurnedImportOptions import;
};

CoilAngle parse_angle(const std::string& text) {
  constexpr std::string_view prefix = "index:";
  if (text == "degrees") return {1.0};
  CoilAngle angle;
  const char* last = text.data() + text.size();
  if (text.starts_with(prefix)) {
    const auto [end, error] = std::from_chars(text.data() + prefix.size(), last, angle.degrees_per_step);
    if (error == std::errc() && end == last && angle.degrees_per_step > 0.0 &&
        angle.degrees_per_step <= 120.0)
      return angle;
  }
  throw ConfigError("--angle " + text + ": give index:5 (the number counts steps of 5 degrees) or degrees");
}

int run_coil(const CoilOptions& options, const std::stop_token& stop) {
  CoilImportOptions import;
  import.angle = parse_angle(options.angle);
  if (options.views == "cropped") import.views = ViewKind::cropped;
  if (options.views == "scene") import.views = ViewKind::scene;
  ConsoleProgress progress;
  const ImportReport report = import_coil(options.folder, options.to, import, progress.callback(), stop);
  progress.clear();
  std::size_t views = 0;
  for (const auto& set : report.sets) views += set.views;
  std::printf("imported %zu objects, %zu views into %s\n", report.sets.size(), views, options.to.c_str());
  std::printf(report.cropped ? "views are cropped: each is taken whole"
                             : "views are scenes: the object is cut out of each");
  std::printf(" (objects fill %.0f %% of them)\n", 100.0 * report.filled);
  return exit_done;
}

int run_turned(const TurnedOptions& options, const std::stop_token& stop) {
  ConsoleProgress progress;
  const auto names = import_turned(options.picture, options.to, options.import, progress.callback(), stop);
  progress.clear();
  std::printf("%zu parts, %zu views each, into %s:", names.size(), options.import.views, options.to.c_str());
  for (const std::string& name : names) std::printf(" %s", name.c_str());
  std::printf("\n");
  return exit_done;
}

void add_coil(CLI::App& import, CommandLine& line) {
  auto options = std::make_shared<CoilOptions>();
  CLI::App* command =
      import.add_subcommand("coil", "Pictures of turned objects, named as in COIL-20 and COIL-100");
  command->footer(coil_examples);
  command->add_option("folder", options->folder, "Folder with the pictures")->required();
  command->add_option("--to", options->to, "Folder for the image sets")->required();
  command->add_option("--angle", options->angle, "What the number in a name means: index:STEP or degrees")
      ->required();
  command->add_option("--views", options->views, "auto, cropped (the object alone) or scene (cut it out)")
      ->check(CLI::IsMember({"auto", "cropped", "scene"}))
      ->capture_default_str();
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_coil(*options, line.stop); }; });
}

void add_turned(CLI::App& import, CommandLine& line) {
  auto options = std::make_shared<TurnedOptions>();
  CLI::App* command = import.add_subcommand("turned", "One picture of parts that lie flat under the camera");
  command->footer(turned_examples);
  command->add_option("picture", options->picture, "The picture")->required();
  command->add_option("--to", options->to, "Folder for the image sets")->required();
  command->add_option("--names", options->import.names, "Names of the parts, from left to right: a,b,c")
      ->delimiter(',');
  command->add_option("--count", options->import.views, "Views around a turn")
      ->check(CLI::Range(2, 3600))
      ->capture_default_str();
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_turned(*options, line.stop); }; });
}

}  // namespace

void add_import_command(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("import", "Turn photographs into image sets");
  command->require_subcommand(1);
  command->footer(
      "'eigenpose import coil --help' and 'eigenpose import turned --help' explain them, with examples.");
  add_coil(*command, line);
  add_turned(*command, line);
}

}  // namespace eigenpose::cli
