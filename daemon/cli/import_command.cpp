/// `eigenpose import`: photographs taken elsewhere become image sets.

#include <charconv>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/dataset/coil_import.h"
#include "core/dataset/table_import.h"
#include "core/dataset/turned_import.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/left_out_report.h"

namespace eigenpose::cli {
namespace {

constexpr const char* coil_examples = R"(
The pictures are named OBJECT__NUMBER.png. Each object becomes an image set SETS/OBJECT.
  --angle index:5    the number counts pictures, 5 degrees apart (COIL-20)
  --angle degrees    the number is the angle (COIL-100)

Examples:
  eigenpose import coil coil-20-proc --to sets/coil-20 --angle index:5
  eigenpose import coil coil-100 --to sets/coil-100 --angle degrees

Numbers may be uneven or have decimals (mug__12.5.png). A picture that cannot be used is left out with a warning, and a
gap in the turn is named; --strict refuses both. An import that was interrupted continues when it is called again.

Views that show the object from edge to edge are taken whole later on, others are segmented. Which it is, is measured
over the whole folder and kept in each set.json; --views overrules it.)";

constexpr const char* table_examples = R"(
The table is comma-separated text (CSV), as every spreadsheet saves it. Its first line names the columns:

  file,object,table_deg,light_deg
  shots/0001.png,mug,0,-30
  shots/0002.png,mug,12.5,-30
  "shots/duck, left.png",duck,7,30

  file      the picture, relative to the table's folder
  object    its name: 1 to 64 letters, digits, _ . or -; each object becomes an image set SETS/OBJECT
  others    one degree of freedom each, its name ending in its unit: table_deg, x_mm, tilt_rad

Views may stand at any poses: uneven, with gaps, a grid or no grid. An angle closes on itself (360 degrees) when its
values leave no gap larger than 120 degrees around the circle, such as 0, 120, 240; else it has two ends, such as a
light from -60 to 60. --periodic and --open say otherwise. A column that never changes is no degree of freedom.

Examples:
  eigenpose import table poses.csv --to sets
  eigenpose import table poses.csv --to sets --open table --ignore note,operator
  eigenpose learn sets --to lab.model)";

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
  bool strict = false;
};

struct TableOptions {
  std::string table;
  std::string to;
  std::string views = "auto";
  bool strict = false;
  TableImportOptions import;
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

ViewKind view_kind(const std::string& text) {
  if (text == "cropped") return ViewKind::cropped;
  return text == "scene" ? ViewKind::scene : ViewKind::measured;
}

void print(const ImportReport& report, const std::string& folder) {
  print_warnings(report.warnings);
  print_left_out(report.left_out);
  std::size_t views = 0;
  std::size_t stood_there = 0;
  for (const auto& set : report.sets) {
    views += set.views;
    if (set.stood_there) ++stood_there;
  }
  std::printf("imported %zu objects, %zu views into %s\n", report.sets.size(), views, folder.c_str());
  if (stood_there > 0) std::printf("%zu of them stood there from an earlier run\n", stood_there);
  std::printf(report.cropped ? "views are cropped: each is taken whole"
                             : "views are scenes: the object is cut out of each");
  std::printf(" (%.0f %% of views are filled edge to edge)\n", 100.0 * report.filled);
}

int run_coil(const CoilOptions& options, const std::stop_token& stop) {
  CoilImportOptions import;
  import.angle = parse_angle(options.angle);
  import.views = view_kind(options.views);
  if (options.strict) import.bad_views = BadViews::refuse;
  ConsoleProgress progress;
  const ImportReport report = import_coil(options.folder, options.to, import, progress.callback(), stop);
  progress.clear();
  print(report, options.to);
  return exit_done;
}

int run_table(TableOptions options, const std::stop_token& stop) {
  options.import.views = view_kind(options.views);
  if (options.strict) options.import.bad_views = BadViews::refuse;
  ConsoleProgress progress;
  try {
    const ImportReport report =
        import_table(options.table, options.to, options.import, progress.callback(), stop);
    progress.clear();
    print(report, options.to);
  } catch (const std::invalid_argument& wrong) {
    throw ConfigError(std::string("--periodic, --open, --ignore: ") + wrong.what());
  }
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

void add_view_options(CLI::App& command, std::string& views, bool& strict) {
  command.add_option("--views", views, "auto, cropped (the object alone) or scene (cut it out)")
      ->check(CLI::IsMember({"auto", "cropped", "scene"}))
      ->capture_default_str();
  command.add_flag("--strict", strict, "Refuse a picture that cannot be used, instead of leaving it out");
}

void add_table(CLI::App& import, CommandLine& line) {
  auto options = std::make_shared<TableOptions>();
  CLI::App* command =
      import.add_subcommand("table", "Pictures listed in a table with their objects and poses");
  command->footer(table_examples);
  command->add_option("table", options->table, "The table, comma-separated")->required();
  command->add_option("--to", options->to, "Folder for the image sets")->required();
  command
      ->add_option("--periodic", options->import.periodic, "Angles that close on themselves, e.g. table,tilt")
      ->delimiter(',');
  command->add_option("--open", options->import.open, "Angles that do not close, whatever their values")
      ->delimiter(',');
  command
      ->add_option("--ignore", options->import.ignore,
                   "Columns that are no degree of freedom, e.g. note,time")
      ->delimiter(',');
  add_view_options(*command, options->views, options->strict);
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_table(*options, line.stop); }; });
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
  add_view_options(*command, options->views, options->strict);
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
  add_coil(*command, line);
  add_table(*command, line);
  add_turned(*command, line);
  command->footer(
      "'eigenpose import coil --help', 'import table --help' and 'import turned --help' explain them, with "
      "examples.");
}

}  // namespace eigenpose::cli
