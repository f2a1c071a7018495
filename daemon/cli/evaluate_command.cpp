/// `eigenpose evaluate`: how well objects are distinguished, measured on views that were not learned.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/evaluation/evaluation.h"
#include "core/evaluation/reliability.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/evaluation_files.h"
#include "daemon/cli/evaluation_report.h"
#include "daemon/cli/learning_options.h"
#include "daemon/cli/recognizer_options.h"

namespace eigenpose::cli {
namespace {

constexpr const char* evaluate_examples = R"(
Learns every k-th view of each object and recognises all others. Nothing of a test view influences learning or
thresholds. A view of a known object is answered right, answered wrong (another object is named) or withheld (unknown,
ambiguous, at the border, nothing found). An unknown object that gets a name, an ambiguous one too, is falsely accepted.
Recognition is the share of views whose nearest object is the right one, whatever was answered; pose errors are over them.

Examples:
  eigenpose evaluate sets/coil-20 --learn-every 2 --components 20 --size 128
  eigenpose evaluate sets/coil-100 --learn-every 4 --color --json > result.json
  eigenpose evaluate sets/coil-20 --objects obj1,obj5
  eigenpose evaluate sets/coil-20 --perturb shift=2,scale=0.03,rotation=3 --seed 7
  eigenpose evaluate sets/coil-20 --occlude 0.2 --leave-one-out
  eigenpose evaluate sets/coil-20 --leave-one-out --false-acceptance 0.01 --roc roc.svg --calibration confidence.svg
  eigenpose evaluate sets/coil-20 --csv regions.csv --confusion confusion.svg
  eigenpose evaluate sets/table --scenes 200                (several objects in one picture, apart)
  eigenpose evaluate sets/table --scenes 200 --overlap 0.2  (touching, or occluding one another a little))";

struct EvaluateOptions {
  std::string sets;
  std::size_t learn_every = 2;
  std::size_t offset = 0;
  LearningArguments learning;
  RecognizerOptions recognizer;
  std::vector<std::string> perturb;
  double occlude = 0.0;
  unsigned seed = 1;
  bool leave_one_out = false;
  SceneOptions scenes;
  EvaluationFiles files;
  bool as_json = false;
};

/// "shift=2,scale=0.03,rotation=3" and --occlude. @throws ConfigError for another name or a value out of
/// range.
TestDamage parse_damage(const EvaluateOptions& options) {
  TestDamage damage;
  damage.seed = options.seed;
  if (!std::isfinite(options.occlude)) throw ConfigError("--occlude: give a share of 0 to 0.9");
  damage.occlusion = options.occlude;
  std::set<std::string> given;
  for (const std::string& item : options.perturb) {
    const auto equals = item.find('=');
    const std::string name = item.substr(0, equals);
    const char* number = equals == std::string::npos ? "" : item.c_str() + equals + 1;
    char* end = nullptr;
    const double value = std::strtod(number, &end);
    double* field = name == "shift"      ? &damage.shift
                    : name == "scale"    ? &damage.scale
                    : name == "rotation" ? &damage.rotation_deg
                                         : nullptr;
    const double most = name == "shift" ? 64.0 : name == "scale" ? 0.9 : 180.0;
    if (field == nullptr || end == number || *end != '\0' || !(value >= 0.0 && value <= most))
      throw ConfigError(
          "--perturb: \"" + item +
          "\" is not one of shift=PIXELS (to 64), scale=SHARE (to 0.9), rotation=DEGREES (to 180)");
    if (!given.insert(name).second) throw ConfigError("--perturb: " + name + " is given twice");
    *field = value;
  }
  return damage;
}

int run_evaluate(const EvaluateOptions& options, const std::stop_token& stop) {
  check_evaluation_files(options.files, options.leave_one_out);
  const auto sets = open_chosen_sets(options.sets, options.learning);
  EvaluationOptions evaluation;
  evaluation.learn_every = options.learn_every;
  evaluation.offset = options.offset;
  evaluation.learning = learning_options(options.learning, sets, options.sets);
  evaluation.threads = options.learning.options.threads;
  evaluation.recognizer = options.recognizer;
  evaluation.damage = parse_damage(options);
  evaluation.leave_one_out = options.leave_one_out;
  if (options.scenes.overlap && options.scenes.count == 0)
    throw ConfigError(
        "--overlap says how the objects of --scenes stand; give their number too, as in --scenes 200");
  evaluation.scenes = options.scenes;
  evaluation.scenes.seed = options.seed;
  ConsoleProgress progress;
  const EvaluationReport report = evaluate(sets, evaluation, progress.callback(), stop);
  progress.clear();
  write_evaluation_files(options.files, report);
  std::optional<Reliability> confidence;
  if (!options.files.calibration.empty()) confidence = reliability(report.records);
  if (options.as_json)
    std::printf("%s\n", evaluation_json(report, confidence).dump(2).c_str());
  else
    print_evaluation(report, confidence);
  return exit_done;
}

void add_file_options(CLI::App& command, EvaluationFiles& files) {
  command.add_option(
      "--roc", files.roc,
      "Write false rejection against false acceptance for every threshold, .csv or .svg; needs "
      "--leave-one-out");
  command.add_option("--calibration", files.calibration,
                     "Write confidence against the share that is right, .csv or .svg");
  command.add_option("--csv", files.csv, "Write one line for each shown region");
  command.add_option("--confusion", files.confusion,
                     "Write what was said of which object as a picture, .svg");
}

}  // namespace

void add_evaluate_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command =
      app.add_subcommand("evaluate", "Measure recognition and pose on views that were not learned");
  command->footer(evaluate_examples);
  command->add_option("sets", options->sets, "Folder of image sets")->required();
  command->add_option("--learn-every", options->learn_every, "Learn every k-th view, test on the others")
      ->check(CLI::Range(2, 10000))
      ->capture_default_str();
  command->add_option("--offset", options->offset, "The first view that is learned")->capture_default_str();
  add_learning_options(*command, options->learning);
  add_recognizer_options(*command, options->recognizer);
  command
      ->add_option(
          "--perturb", options->perturb,
          "Move test pictures at random, each way: shift=PIXELS (of 128), scale=SHARE, rotation=DEGREES")
      ->delimiter(',');
  command->add_option("--occlude", options->occlude, "Hide this share of test pictures behind a black square")
      ->check(CLI::Range(0.0, 0.9));
  command->add_option("--seed", options->seed, "Seed of --perturb, --occlude and --scenes")
      ->capture_default_str();
  command->add_flag("--leave-one-out", options->leave_one_out,
                    "Also show each object, damaged likewise, to a model without it: unknown objects");
  command
      ->add_option("--scenes", options->scenes.count,
                   "Also show this number of scenes composed of test views, 2 to 4 objects each")
      ->check(CLI::Range(0, 1000000));
  command
      ->add_option(
          "--overlap", options->scenes.overlap,
          "Objects of a scene touch, and occlude up to this share of each other; without it they stand "
          "apart")
      ->check(CLI::Range(0.0, 0.9));
  add_file_options(*command, options->files);
  command->add_flag("--json", options->as_json, "Print the result as JSON");
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_evaluate(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
