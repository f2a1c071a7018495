#pragma once

/// The options of learning that `learn` and `evaluate` share.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/dataset/image_set.h"
#include "core/learning/learning.h"

namespace CLI {
class App;
}

namespace eigenpose::cli {

/// What the line says of learning: the library's own options where a flag is one of them, and what has yet to
/// be translated into them.
struct LearningArguments {
  LearningOptions options;
  std::string type;  ///< --type
  bool color = false;
  bool grey = false;
  bool whole_region = false;
  double memory_limit_mib = 0.0;
  std::vector<std::string> objects;
  bool strict = false;
  double false_rejection = DecisionRates{}.false_rejection;    ///< --false-rejection
  double false_acceptance = DecisionRates{}.false_acceptance;  ///< --false-acceptance
};

/// Adds --components, --energy, --size, --type, --color, --grey, --whole-region, --solver, --degree,
/// --threads, --memory-limit, --objects, --false-rejection and --false-acceptance.
void add_learning_options(CLI::App& command, LearningArguments& arguments);

/// Names of those among them that a model, once learned, is bound to.
std::vector<std::string> fixed_learning_options();

/// The image sets below `folder`, only those named by --objects if any.
/// @throws FileError, ConfigError naming an object that is not there.
std::vector<ImageSet> open_chosen_sets(const std::string& folder, const LearningArguments& arguments);

/// The same for learning: sets that cannot be opened, or are not complete, are left out and named, unless
/// --strict is given.
std::vector<ImageSet> open_learned_sets(const std::string& folder, const LearningArguments& arguments,
                                        std::vector<LeftOut>& left_out);

/// As a model's provenance names it.
std::string absolute_folder(const std::string& folder);

/// "76.0 % of the scatter (within 0.7 %)"; without a bound that shows, the share alone.
std::string energy_text(double energy, double bound);

/// The two rates that the line sets, in the library's options.
void set_rates(const LearningArguments& arguments, LearningOptions& options);

/// --memory-limit in bytes.
std::size_t memory_limit(const LearningArguments& arguments);

/// @throws FileError naming a set that is not complete.
void check_complete(std::span<const ImageSet> sets);

/// Colour is taken when all views are in colour, unless --type, --color or --grey says otherwise.
/// @throws ConfigError for an unknown image type, or one that the views are not fit for.
LearningOptions learning_options(const LearningArguments& arguments, std::span<const ImageSet> sets,
                                 const std::string& folder);

}  // namespace eigenpose::cli
