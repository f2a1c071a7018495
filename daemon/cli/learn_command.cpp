/// `eigenpose learn`: image sets become a model.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/model/model_file.h"
#include "core/recognition/learning.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/learning_options.h"
#include "daemon/cli/service_client.h"

namespace eigenpose::cli {
namespace {

constexpr const char* learn_examples = R"(
Examples:
  eigenpose learn sets/coil-20 --to coil-20.model --size 128
  eigenpose learn sets/lab --to lab.model --energy 0.95 --components 60
  eigenpose learn sets/lab --to lab.model --objects mug,duck
  eigenpose learn sets/lab --to lab.model --type grey:0.7+gradient:0.3
  eigenpose learn sets/large --to large.model --memory-limit 256
  eigenpose learn                              the running service learns what it has acquired and watches with it

The model is written at once when all is learned; a former model of that name stays until then.)";

struct LearnOptions {
  std::string sets;
  std::string to;
  LearningArguments learning;
  ServiceOptions service;
};

double seconds(Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

/// NaN of nothing.
double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void print(const Model& model, const LearningReport& report, const std::string& file) {
  std::printf("%-16s %6s %18s  %s\n", "object", "views", "rejection distance", "pose");
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const ModelObject& object = model.objects[o];
    const double error = median(report.evidence[o].left_out_errors.front());
    std::printf("%-16s %6zu %18.4f  ", object.name.c_str(), object.views, model.rejection_distance(o));
    if (!object.pose_observable)
      std::printf("cannot be seen: left-out views are %.0f %s off\n", error,
                  object.workspace[0].unit.c_str());
    else if (std::isnan(error))
      std::printf("not checked: too few views\n");
    else
      std::printf("left-out views are found within %.1f %s (median)\n", error,
                  object.workspace[0].unit.c_str());
  }
  if (!report.solver.note.empty()) std::printf("note: %s\n", report.solver.note.c_str());
  std::printf(
      "learned %zu objects from %zu views in %.1f s: %zu dimensions by %s keep %.1f %% of the scatter\n",
      model.objects.size(), report.views, seconds(report.total_time), report.solver.components,
      report.solver.solver.c_str(), 100.0 * report.solver.energy);
  std::printf("model: %s\n", file.c_str());
}

int run_learn(const LearnOptions& options, const CLI::App& command, const std::stop_token& stop) {
  if (options.sets.empty()) {
    const int components =
        command.count("--components") > 0 ? static_cast<int>(options.learning.components) : 0;
    return learn_at_service(options.service, components, stop);
  }
  if (options.to.empty()) throw Error("the model needs a name: add --to FILE");
  const auto sets = open_chosen_sets(options.sets, options.learning);
  LearningOptions learning = learning_options(options.learning, sets, options.sets);
  const auto folder = std::filesystem::path(options.to).parent_path();
  learning.scratch_folder = folder.empty() ? "." : folder;  // where there is room for the model
  ConsoleProgress progress;
  LearningReport report;
  const Model model = learn(all_views(sets), learning, &report, progress.callback(), stop);
  save_model(model, options.to);
  progress.clear();
  print(model, report, options.to);
  return exit_done;
}

}  // namespace

void add_learn_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<LearnOptions>();
  CLI::App* command = app.add_subcommand("learn", "Learn a model from image sets");
  command->footer(learn_examples);
  command->add_option("sets", options->sets,
                      "Folder of image sets; without it the running service learns what it has acquired");
  command->add_option("--to", options->to, "The model file to write");
  add_learning_options(*command, options->learning);
  add_service_options(*command, options->service);
  command->callback([options, command, &line] {
    line.action = [options, command, &line] { return run_learn(*options, *command, line.stop); };
  });
}

}  // namespace eigenpose::cli
