#include "daemon/cli/learning_options.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <system_error>

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

/// The type of a set's first picture that can be read; nothing where none can.
std::optional<int> picture_type(const ImageSet& set) {
  for (std::size_t i = 0; i < set.views().size(); ++i) try {
      return set.load(i).type();
    } catch (const FileError&) {
      continue;  // named when it is learned
    }
  return std::nullopt;
}

/// The first set that holds no colour pictures.
const ImageSet* first_grey(std::span<const ImageSet> sets) {
  for (const ImageSet& set : sets)
    if (const auto type = picture_type(set); type && CV_MAT_CN(*type) != 3) return &set;
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
      if (picture_type(set).value_or(CV_16UC1) != CV_16UC1)
        throw ConfigError("--type " + arguments.type + ": the views of \"" + set.object() +
                          "\" are not 16-bit grey pictures; they hold no range");
}

}  // namespace

void add_learning_options(CLI::App& command, LearningArguments& arguments) {
  command.add_option("--components", arguments.options.solver.components, "Dimensions of the eigenspace (K)")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  command
      .add_option("--energy", arguments.options.solver.energy,
                  "Keep this share of the scatter (0…1) in at most K dimensions")
      ->check(CLI::Range(0.0, 1.0));
  command.add_option("--size", arguments.options.normalization.size, "Side of a normalised view, pixels")
      ->check(CLI::Range(8, 256))
      ->capture_default_str();
  auto* color =
      command.add_flag("--color", arguments.color,
                       "Use colour, as brightness and opponent colours (default if the views have it)");
  auto* grey = command.add_flag("--grey", arguments.grey, "Use brightness only")->excludes(color);
  command.add_option("--type", arguments.type, type_help())->excludes(color)->excludes(grey);
  command.add_flag("--whole-region", arguments.whole_region,
                   "Compare whole regions alone: no windows, no alignment");
  command
      .add_option("--solver", arguments.options.solver.solver,
                  "auto, gram, krylov, conjugate-gradient, sta or joined")
      ->check(CLI::IsMember({"auto", "gram", "krylov", "conjugate-gradient", "sta", "joined"}))
      ->capture_default_str();
  command.add_option("--degree", arguments.options.spline_degree, "Degree of the spline: 1, 2 or 3")
      ->check(CLI::Range(1, 3))
      ->capture_default_str();
  command.add_option("--threads", arguments.options.threads, "Threads; 0 means all cores")
      ->capture_default_str();
  command
      .add_option("--memory-limit", arguments.memory_limit_mib,
                  "MiB for views and solver; views that do not fit are kept on disk. 0 means no limit")
      ->check(CLI::Range(0.0, 1e9));
  command
      .add_option("--false-rejection", arguments.false_rejection,
                  "Share of views of known objects that may be called unknown (0…0.5)")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  command
      .add_option("--false-acceptance", arguments.false_acceptance,
                  "Share of views of unknown objects that may get a name (0…1)")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--objects", arguments.objects, "Only these objects, e.g. obj1,obj2")->delimiter(',');
}

std::vector<std::string> fixed_learning_options() {
  return {"--components",
          "--energy",
          "--size",
          "--color",
          "--grey",
          "--type",
          "--solver",
          "--degree",
          "--whole-region",
          "--false-rejection",
          "--false-acceptance"};
}

namespace {

/// The name of the folder that a file of an image set stands in, or of the folder itself.
std::string object_of(const std::filesystem::path& file) {
  std::error_code error;
  return (std::filesystem::is_directory(file, error) ? file : file.parent_path()).filename().string();
}

/// Only the sets named by --objects, if any. @param left_out objects that are there, but cannot be used.
/// @throws ConfigError naming an object that is not there.
std::vector<ImageSet> chosen(std::vector<ImageSet> sets, const std::string& folder,
                             const LearningArguments& arguments, std::vector<LeftOut>& left_out) {
  if (arguments.objects.empty()) return sets;
  const auto wanted = [&](const std::string& object) {
    return std::find(arguments.objects.begin(), arguments.objects.end(), object) != arguments.objects.end();
  };
  for (const std::string& name : arguments.objects) {
    const bool there =
        std::any_of(sets.begin(), sets.end(), [&](const ImageSet& set) { return set.object() == name; }) ||
        std::any_of(left_out.begin(), left_out.end(),
                    [&](const LeftOut& what) { return what.object == name; });
    if (there) continue;
    std::string known;
    for (const ImageSet& set : sets) known += (known.empty() ? "" : ", ") + set.object();
    throw ConfigError(std::string("--objects: there is no \"")
                          .append(name)
                          .append("\" in ")
                          .append(folder)
                          .append("; there are: ")
                          .append(known));
  }
  std::erase_if(sets, [&](const ImageSet& set) { return !wanted(set.object()); });
  std::erase_if(left_out, [&](const LeftOut& what) { return !wanted(what.object); });
  if (sets.empty()) throw ConfigError("--objects: none of them can be used. " + left_out.front().text());
  return sets;
}

}  // namespace

std::vector<ImageSet> open_chosen_sets(const std::string& folder, const LearningArguments& arguments) {
  std::vector<LeftOut> none;
  return chosen(open_image_sets(folder), folder, arguments, none);
}

std::vector<ImageSet> open_learned_sets(const std::string& folder, const LearningArguments& arguments,
                                        std::vector<LeftOut>& left_out) {
  if (arguments.strict) {
    std::vector<ImageSet> sets = open_chosen_sets(folder, arguments);
    check_complete(sets);
    return sets;
  }
  FoundImageSets found = find_image_sets(folder);
  for (const FileError& wrong : found.left_out)
    left_out.push_back({object_of(wrong.file()), {}, true, wrong.what()});
  std::erase_if(found.sets, [&](const ImageSet& set) {
    if (!set.complete())
      left_out.push_back(
          {set.object(), set.folder(), true, "is not complete; acquire or import it to its end"});
    return !set.complete();
  });
  if (found.sets.empty())
    throw ConfigError("there is no image set that can be used. " + left_out.front().text());
  return chosen(std::move(found.sets), folder, arguments, left_out);
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

void set_rates(const LearningArguments& arguments, LearningOptions& options) {
  options.rates = {arguments.false_rejection, arguments.false_acceptance};
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
  check_complete(sets);
  LearningOptions options = arguments.options;
  choose_type(arguments, sets, options.normalization);
  options.parts = !arguments.whole_region;
  options.memory_limit = memory_limit(arguments);
  set_rates(arguments, options);
  options.image_sets = absolute_folder(folder);
  options.program_version = EIGENPOSE_VERSION;
  return options;
}

}  // namespace eigenpose::cli
