#include "daemon/cli/learning_options.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/image/image_type.h"

namespace eigenpose::cli {
namespace {

std::string type_help() {
  std::string text = "What of a picture is compared: ";
  for (const ImageTypeRow& row : image_types())
    text += std::string(row.name) + " (" + std::string(row.summary) + "), ";
  return text + "or a sum such as grey+gradient or grey:0.7+gradient:0.3";
}

/// The first view that is no colour picture.
const ImageSet* first_grey(std::span<const ImageSet> sets) {
  for (const ImageSet& set : sets)
    if (set.load(0).channels() != 3) return &set;
  return nullptr;
}

void choose_type(const LearningArguments& arguments, std::span<const ImageSet> sets,
                 NormalizationOptions& options) {
  const ImageSet* grey = first_grey(sets);
  if (arguments.type.empty()) {
    if (arguments.color && grey != nullptr)
      throw ConfigError("--color: the views of \"" + grey->object() + "\" are grey; leave --color out");
    options.color = !arguments.grey && grey == nullptr;
    return;
  }
  try {
    set_image_type(options, arguments.type);
  } catch (const std::invalid_argument& wrong) {
    throw ConfigError(std::string("--type: ") + wrong.what());
  }
  if (options.color && grey != nullptr)
    throw ConfigError("--type " + arguments.type + ": the views of \"" + grey->object() +
                      "\" are grey; colour is not to be had from them");
  if (is_range(options))
    for (const ImageSet& set : sets)
      if (set.load(0).type() != CV_16UC1)
        throw ConfigError("--type " + arguments.type + ": the views of \"" + set.object() +
                          "\" are not 16-bit grey pictures; they hold no range");
}

}  // namespace

void add_learning_options(CLI::App& command, LearningArguments& arguments) {
  command.add_option("--components", arguments.components, "Dimensions of the eigenspace (K)")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  command
      .add_option("--energy", arguments.energy,
                  "Keep this share of the scatter (0…1) in at most K dimensions")
      ->check(CLI::Range(0.0, 1.0));
  command.add_option("--size", arguments.size, "Side of a normalised view, pixels")
      ->check(CLI::Range(8, 256))
      ->capture_default_str();
  auto* color = command.add_flag("--color", arguments.color,
                                 "Use colour, all bands jointly (default if the views have it)");
  auto* grey = command.add_flag("--grey", arguments.grey, "Use brightness only")->excludes(color);
  command.add_option("--type", arguments.type, type_help())->excludes(color)->excludes(grey);
  command.add_flag("--whole-region", arguments.whole_region,
                   "Compare whole regions alone: no windows, no alignment");
  command
      .add_option("--solver", arguments.solver,
                  "auto, gram, krylov, conjugate-gradient, sta, joined or dense")
      ->check(CLI::IsMember({"auto", "gram", "krylov", "conjugate-gradient", "sta", "joined", "dense"}))
      ->capture_default_str();
  command.add_option("--degree", arguments.degree, "Degree of the spline: 1, 2 or 3")
      ->check(CLI::Range(1, 3))
      ->capture_default_str();
  command.add_option("--threads", arguments.threads, "Threads; 0 means all cores")->capture_default_str();
  command
      .add_option("--memory-limit", arguments.memory_limit_mib,
                  "MiB for views and solver; views that do not fit are kept on disk. 0 means no limit")
      ->check(CLI::Range(0.0, 1e9));
  command.add_option("--objects", arguments.objects, "Only these objects, e.g. obj1,obj2")->delimiter(',');
}

std::vector<std::string> fixed_learning_options() {
  return {"--components", "--energy", "--size",   "--color",       "--grey",
          "--type",       "--solver", "--degree", "--whole-region"};
}

std::vector<ImageSet> open_chosen_sets(const std::string& folder, const LearningArguments& arguments) {
  std::vector<ImageSet> sets = open_image_sets(folder);
  if (arguments.objects.empty()) return sets;
  for (const std::string& name : arguments.objects)
    if (std::none_of(sets.begin(), sets.end(), [&](const ImageSet& set) { return set.object() == name; })) {
      std::string known;
      for (const ImageSet& set : sets) known += (known.empty() ? "" : ", ") + set.object();
      throw ConfigError(std::string("--objects: there is no \"")
                            .append(name)
                            .append("\" in ")
                            .append(folder)
                            .append("; there are: ")
                            .append(known));
    }
  std::erase_if(sets, [&](const ImageSet& set) {
    return std::find(arguments.objects.begin(), arguments.objects.end(), set.object()) ==
           arguments.objects.end();
  });
  return sets;
}

std::string absolute_folder(const std::string& folder) {
  return std::filesystem::absolute(folder).lexically_normal().string();
}

std::string energy_text(double energy, double bound) {
  char text[64];
  if (bound < 0.0005)
    std::snprintf(text, sizeof text, "%.1f %% of the scatter", 100.0 * energy);
  else
    std::snprintf(text, sizeof text, "%.1f %% of the scatter (within %.1f %%)", 100.0 * energy,
                  100.0 * bound);
  return text;
}

std::size_t memory_limit(const LearningArguments& arguments) {
  return static_cast<std::size_t>(arguments.memory_limit_mib * 1024.0 * 1024.0);
}

void check_complete(std::span<const ImageSet> sets) {
  for (const ImageSet& set : sets)
    if (!set.complete())
      throw FileError(set.folder(),
                      "is not complete; acquire or import it to its end, or leave it out with --objects");
}

LearningOptions learning_options(const LearningArguments& arguments, std::span<const ImageSet> sets,
                                 const std::string& folder) {
  LearningOptions options;
  check_complete(sets);
  options.normalization.size = arguments.size;
  choose_type(arguments, sets, options.normalization);
  options.parts = !arguments.whole_region;
  options.memory_limit = memory_limit(arguments);
  options.solver.solver = arguments.solver;
  options.solver.components = arguments.components;
  options.solver.energy = arguments.energy;
  options.spline_degree = arguments.degree;
  options.threads = arguments.threads;
  options.image_sets = absolute_folder(folder);
  options.program_version = EIGENPOSE_VERSION;
  return options;
}

}  // namespace eigenpose::cli
