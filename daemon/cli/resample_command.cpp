/// `eigenpose resample`: learned manifolds as tables.

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/base/printable.h"
#include "core/model/model_file.h"
#include "core/model/resampled_file.h"
#include "daemon/cli/commands.h"

namespace eigenpose::cli {
namespace {

constexpr const char* resample_examples = R"(
Writes points of the continuous manifolds, evenly spaced along each degree of freedom. HDF5 (.h5) has one group an
object with the tables q and points; CSV has one file an object.

Examples:
  eigenpose resample lab.model --per-turn 360 --to lab.h5
  eigenpose resample lab.model --objects mug --to mug.csv)";

struct ResampleOptions {
  std::string model;
  std::string to;
  std::vector<std::string> objects;
  ResamplingOptions resampling;
};

std::vector<std::size_t> chosen_objects(const Model& model, const std::vector<std::string>& names) {
  std::vector<std::size_t> chosen;
  for (std::size_t o = 0; o < model.objects.size(); ++o)
    if (names.empty()) chosen.push_back(o);
  for (const std::string& name : names) {
    std::size_t o = 0;
    while (o < model.objects.size() && model.objects[o].name != name) ++o;
    if (o == model.objects.size())
      throw ConfigError("--objects: the model has no \"" + name +
                        "\"; 'eigenpose inspect' lists its objects");
    if (std::find(chosen.begin(), chosen.end(), o) != chosen.end())
      throw ConfigError("--objects: \"" + name + "\" is named twice");
    chosen.push_back(o);
  }
  return chosen;
}

int run_resample(const ResampleOptions& options) {
  const Model model = load_model(options.model);
  const auto files =
      write_resampled(model, chosen_objects(model, options.objects), options.resampling, options.to);
  for (const auto& file : files) std::printf("%s\n", printable(file.string()).c_str());
  return exit_done;
}

}  // namespace

void add_resample_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<ResampleOptions>();
  CLI::App* command = app.add_subcommand("resample", "Write a model's manifolds as dense tables");
  command->footer(resample_examples);
  command->add_option("model", options->model, "The model file")->required();
  command->add_option("--to", options->to, "The file to write: .h5 or .csv")->required();
  command->add_option("--per-turn", options->resampling.per_turn, "Points on a closed axis")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command
      ->add_option("--per-step", options->resampling.per_step,
                   "Points from one learned value of an open axis to the next")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  command->add_option("--objects", options->objects, "Only these objects, e.g. mug,duck")->delimiter(',');
  command->callback([options, &line] { line.action = [options] { return run_resample(*options); }; });
}

}  // namespace eigenpose::cli
