/// `eigenpose import`: photographs taken elsewhere become image sets.

#include <charconv>
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/image/coil_import.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"

namespace eigenpose::cli {
namespace {

constexpr const char* import_examples = R"(
The pictures are named OBJECT__NUMBER.png. Each object becomes an image set SETS/OBJECT.
  --angle index:5    the number counts pictures, 5 degrees apart (COIL-20)
  --angle degrees    the number is the angle (COIL-100)

Examples:
  eigenpose import coil coil-20-proc --to sets/coil-20 --angle index:5
  eigenpose import coil coil-100 --to sets/coil-100 --angle degrees

Views that show the object from edge to edge are taken whole later on, others are segmented. Which it is, is measured
over the whole folder and kept in each set.json; --views overrules it.)";

struct ImportOptions {
  std::string naming;
  std::string folder;
  std::string to;
  std::string angle;
  std::string views = "auto";
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

int run_import(const ImportOptions& options, const std::stop_token& stop) {
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

}  // namespace

void add_import_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<ImportOptions>();
  CLI::App* command = app.add_subcommand("import", "Turn photographs into image sets");
  command->footer(import_examples);
  command->add_option("naming", options->naming, "How the pictures are named: coil")
      ->required()
      ->check(CLI::IsMember({"coil"}));
  command->add_option("folder", options->folder, "Folder with the pictures")->required();
  command->add_option("--to", options->to, "Folder for the image sets")->required();
  command->add_option("--angle", options->angle, "What the number in a name means: index:STEP or degrees")
      ->required();
  command->add_option("--views", options->views, "auto, cropped (the object alone) or scene (cut it out)")
      ->check(CLI::IsMember({"auto", "cropped", "scene"}))
      ->capture_default_str();
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_import(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
