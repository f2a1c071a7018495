/// `eigenpose evaluate`: how well objects are distinguished, measured on views that were not learned.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/evaluation/evaluation.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/learning_options.h"
#include "daemon/cli/recognizer_options.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

constexpr const char* evaluate_examples = R"(
Learns every k-th view of each object and recognises all others. Nothing of a test view influences learning or
thresholds. A view counts as recognised when the nearest object is the right one; how many of those would have been
reported as unknown or ambiguous is printed beside it. Pose errors are over recognised views.

Examples:
  eigenpose evaluate sets/coil-20 --learn-every 2 --components 20 --size 128
  eigenpose evaluate sets/coil-100 --learn-every 4 --color --json > result.json
  eigenpose evaluate sets/coil-20 --objects obj1,obj5
  eigenpose evaluate sets/coil-20 --perturb shift=2,scale=0.03,rotation=3 --seed 7
  eigenpose evaluate sets/coil-20 --occlude 0.2 --leave-one-out
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
  bool as_json = false;
};

double milliseconds(Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

double micro_per_view(Duration duration, std::size_t views) {
  return 1e3 * milliseconds(duration) / static_cast<double>(views);
}

json scenes_json(const SceneReport& scenes) {
  const auto pose = summarize_errors(scenes.pose_errors);
  const auto n = static_cast<double>(std::max<std::size_t>(scenes.objects, 1));
  return {{"scenes", scenes.scenes},
          {"objects", scenes.objects},
          {"found_rate", static_cast<double>(scenes.found) / n},
          {"right_rate", static_cast<double>(scenes.right) / n},
          {"recognized_rate", static_cast<double>(scenes.recognized) / n},
          {"extra_boxes", scenes.extra},
          {"pose_error_mean_deg", pose.mean},
          {"pose_error_median_deg", pose.median},
          {"pose_gross_rate", pose.gross_rate}};
}

json to_json(const EvaluationReport& report) {
  const auto pose = report.pose_errors();
  json objects = json::array();
  for (const ObjectEvaluation& object : report.objects) {
    const auto errors = summarize_errors(object.pose_errors);
    objects.push_back({{"object", object.object},
                       {"learned_views", object.learned_views},
                       {"test_views", object.test_views},
                       {"right", object.right},
                       {"rejected", object.rejected},
                       {"ambiguous", object.ambiguous},
                       {"nothing_found", object.missed},
                       {"pose_observable", object.pose_observable},
                       {"pose_error_mean_deg", errors.mean},
                       {"pose_error_median_deg", errors.median},
                       {"pose_error_p90_deg", errors.p90},
                       {"pose_gross_rate", errors.gross_rate}});
  }
  json confusions = json::array();
  for (const auto& [pair, views] : report.confusions)
    confusions.push_back({{"object", pair.first}, {"said", pair.second}, {"views", views}});
  const std::size_t n = report.test_views;
  return {{"recognition_rate", report.recognition_rate()},
          {"pose_error_mean_deg", pose.mean},
          {"pose_error_median_deg", pose.median},
          {"pose_error_p90_deg", pose.p90},
          {"pose_gross_rate", pose.gross_rate},
          {"rejected_rate", static_cast<double>(report.rejected) / static_cast<double>(n)},
          {"ambiguous_rate", static_cast<double>(report.ambiguous) / static_cast<double>(n)},
          {"test_views", n},
          {"strangers", report.strangers},
          {"false_accept_rate", report.strangers == 0 ? json(nullptr)
                                                      : json(static_cast<double>(report.false_accepts) /
                                                             static_cast<double>(report.strangers))},
          {"scenes", report.scenes ? scenes_json(*report.scenes) : json(nullptr)},
          {"smallest_rejection_rate", report.smallest_rate},
          {"model_bytes_per_object", report.model_bytes},
          {"learned_views", report.learning.views},
          {"solver", report.learning.solver.solver},
          {"components", report.learning.solver.components},
          {"energy_kept", report.learning.solver.energy},
          {"objects", objects},
          {"confusions", confusions},
          {"times_ms",
           {{"normalize", milliseconds(report.learning.normalize_time)},
            {"eigenspace", milliseconds(report.learning.eigenspace_time)},
            {"manifolds", milliseconds(report.learning.manifold_time)},
            {"rejection", milliseconds(report.learning.rejection_time)},
            {"learning", milliseconds(report.learning.total_time)}}},
          {"times_us_per_view",
           {{"load", micro_per_view(report.load_time, n)},
            {"segment", micro_per_view(report.times.segment, n)},
            {"normalize", micro_per_view(report.times.normalize, n)},
            {"project", micro_per_view(report.times.project, n)},
            {"search", micro_per_view(report.times.search, n)},
            {"recognition", micro_per_view(report.times.total, n)}}}};
}

void print(const EvaluationReport& report) {
  std::printf("%-16s %8s %6s %7s %9s %10s %10s %8s\n", "object", "learned", "tests", "right", "unknown*",
              "ambiguous*", "pose mean", "median");
  for (const ObjectEvaluation& object : report.objects) {
    const auto errors = summarize_errors(object.pose_errors);
    std::printf("%-16s %8zu %6zu %7zu %9zu %10zu %9.2f° %7.2f°%s\n", object.object.c_str(),
                object.learned_views, object.test_views, object.right, object.rejected, object.ambiguous,
                errors.mean, errors.median, object.pose_observable ? "" : "  pose not observable");
  }
  std::printf("* of the right ones: would be reported as unknown or ambiguous\n\n");
  for (const auto& [pair, views] : report.confusions)
    std::printf("confused: %s taken for %s in %zu view(s)\n", pair.first.c_str(), pair.second.c_str(), views);
  const auto pose = report.pose_errors();
  const auto n = static_cast<double>(report.test_views);
  std::printf("recognised  %.2f %% of %zu test views (%zu objects, %zu views learned)\n",
              100.0 * report.recognition_rate(), report.test_views, report.objects.size(),
              report.learning.views);
  std::printf("pose error  mean %.2f°, median %.2f°, 90 %% below %.2f°, above 45°: %.2f %%\n", pose.mean,
              pose.median, pose.p90, 100.0 * pose.gross_rate);
  std::printf("rejected    %.2f %% unknown, %.2f %% ambiguous\n",
              100.0 * static_cast<double>(report.rejected) / n,
              100.0 * static_cast<double>(report.ambiguous) / n);
  if (report.strangers > 0)
    std::printf("unknown     %.2f %% of %zu views of objects left out were falsely accepted\n",
                100.0 * static_cast<double>(report.false_accepts) / static_cast<double>(report.strangers),
                report.strangers);
  if (report.scenes) {
    const SceneReport& scenes = *report.scenes;
    const auto errors = summarize_errors(scenes.pose_errors);
    const auto of_all = [&](std::size_t count) {
      return 100.0 * static_cast<double>(count) /
             static_cast<double>(std::max<std::size_t>(scenes.objects, 1));
    };
    std::printf(
        "scenes      %zu with %zu objects: %.2f %% found, %.2f %% the right object, %.2f %% recognised; %zu "
        "false detections\n"
        "            pose error mean %.2f°, median %.2f°\n",
        scenes.scenes, scenes.objects, of_all(scenes.found), of_all(scenes.right), of_all(scenes.recognized),
        scenes.extra, errors.mean, errors.median);
  }
  std::printf("eigenspace  %zu dimensions by %s, %.1f %% of the scatter\n", report.learning.solver.components,
              report.learning.solver.solver.c_str(), 100.0 * report.learning.solver.energy);
  std::printf("learning    %.0f ms: normalise %.0f, eigenspace %.0f, manifolds %.0f, rejection %.0f\n",
              milliseconds(report.learning.total_time), milliseconds(report.learning.normalize_time),
              milliseconds(report.learning.eigenspace_time), milliseconds(report.learning.manifold_time),
              milliseconds(report.learning.rejection_time));
  const std::size_t views = report.test_views;
  std::printf(
      "a view      %.0f µs: segment %.0f, normalise %.0f, project %.0f, search %.0f (reading the file: "
      "%.0f)\n",
      micro_per_view(report.times.total, views), micro_per_view(report.times.segment, views),
      micro_per_view(report.times.normalize, views), micro_per_view(report.times.project, views),
      micro_per_view(report.times.search, views), micro_per_view(report.load_time, views));
}

/// "shift=2,scale=0.03,rotation=3" and --occlude. @throws ConfigError for another name or a value out of
/// range.
TestDamage parse_damage(const EvaluateOptions& options) {
  TestDamage damage;
  damage.seed = options.seed;
  damage.occlusion = options.occlude;
  for (const std::string& item : options.perturb) {
    const auto equals = item.find('=');
    const std::string name = item.substr(0, equals);
    char* end = nullptr;
    const double value = equals == std::string::npos ? -1.0 : std::strtod(item.c_str() + equals + 1, &end);
    double* field = name == "shift"      ? &damage.shift
                    : name == "scale"    ? &damage.scale
                    : name == "rotation" ? &damage.rotation_deg
                                         : nullptr;
    if (field == nullptr || end == nullptr || *end != '\0' || !(value >= 0.0) ||
        (name == "scale" && value >= 1.0))
      throw ConfigError("--perturb: \"" + item +
                        "\" is not one of shift=PIXELS, scale=SHARE, rotation=DEGREES");
    *field = value;
  }
  return damage;
}

int run_evaluate(const EvaluateOptions& options, const std::stop_token& stop) {
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
  if (options.as_json)
    std::printf("%s\n", to_json(report).dump(2).c_str());
  else
    print(report);
  return exit_done;
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
                    "Also show each object to a model without it: unknown objects");
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
  command->add_flag("--json", options->as_json, "Print the result as JSON");
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_evaluate(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
