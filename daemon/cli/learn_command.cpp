/// `eigenpose learn`: image sets become a model.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/base/file_lock.h"
#include "core/base/printable.h"
#include "core/learning/learning.h"
#include "core/learning/training_archive.h"
#include "core/model/model_file.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/learning_options.h"
#include "daemon/cli/left_out_report.h"
#include "daemon/cli/resemblance_report.h"
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
  eigenpose learn sets/lab --to lab.model --keep-views
  eigenpose learn sets/new --update lab.model          what is new joins lab.model
  eigenpose learn --update lab.model --remove mug,duck
  eigenpose learn                                      the running service learns what it has acquired and watches with it

The model is written at once when all is learned; a former model of that name stays until then.

--keep-views writes FILE.views beside the model: the normalised views, their inner products and what calibration
measured at them; they stand in FILE.views.next while the model is being replaced. --update makes of them the model
that would be learned anew from all image sets, with the options that it was learned with. It reads the images of new
objects alone; the folders of the others may be gone. Old views are measured again where an object that joined or left
is near them; all of them, once a quarter of the objects has changed. To learn an object
anew, remove it and let it join in one command.)";

struct LearnOptions {
  std::string sets;
  std::string to;
  bool keep_views = false;
  std::string update;
  std::vector<std::string> remove;
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

/// A rate in percent. Where none of `n` views showed it, only its bound 1/(n + 1) is known.
std::string rate_text(double rate, std::size_t n) {
  return rate > 0.0 ? fmt::format("{:.2f} %", 100.0 * rate)
                    : fmt::format("under {:.2f} %", 100.0 / (static_cast<double>(n) + 1.0));
}

/// What the views can support of the rates that were set.
void print_rates(const DecisionModel& decision) {
  std::printf("expected: %s of known views rejected (set %.2f %%)",
              rate_text(decision.expected.false_rejection, decision.known.size()).c_str(),
              100.0 * decision.set.false_rejection);
  if (decision.unknown.empty())
    std::printf("; the objects learned tell nothing of unknown ones\n");
  else
    std::printf(", %s of unknown objects accepted (set %.2f %%)\n",
                rate_text(decision.expected.false_acceptance, decision.unknown.size()).c_str(),
                100.0 * decision.set.false_acceptance);
  if (decision.gives_up_false_rejection())
    std::printf(
        "note: the views do not hold both rates; that of false acceptances is held. More views of each "
        "object, or a "
        "higher --false-acceptance, reject fewer known views\n");
}

void print(const Model& model, const LearningReport& report, const std::string& file) {
  std::printf("%-16s %6s %18s  %s\n", "object", "views", "rejection distance", "pose");
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const ModelObject& object = model.objects[o];
    const double error = median(report.evidence[o].left_out_errors.front());
    std::printf("%-16s %6zu %18.4f  ", object.name.c_str(), object.views, model.rejection_distance(o));
    if (!object.pose_observable)
      std::printf("not observable: left-out views are %.0f %s off\n", error,
                  object.workspace[0].unit.c_str());
    else if (std::isnan(error))
      std::printf("not checked: too few views\n");
    else
      std::printf("left-out views are found within %.1f %s (median)\n", error,
                  object.workspace[0].unit.c_str());
  }
  if (report.kept_probes > 0)
    std::printf("calibrated from %zu views shown now and %zu shown to a former model\n", report.shown_views,
                report.kept_probes);
  if (!report.solver.note.empty()) std::printf("note: %s\n", report.solver.note.c_str());
  std::printf("learned %zu objects from %zu views in %.1f s: %zu dimensions by %s keep %s\n",
              model.objects.size(), report.views, seconds(report.total_time), report.solver.components,
              report.solver.solver.c_str(),
              energy_text(report.solver.energy, report.solver.energy_bound).c_str());
  print_rates(model.decision);
  print_resemblance(model);
  std::printf("model: %s\n", printable(file).c_str());
}

std::filesystem::path views_file(const std::string& model) {
  return model + ".views";
}

/// Adds a folder to those that a model was learned from, unless it is among them. Of very many the first are
/// named.
void add_folder(std::string& folders, const std::string& folder) {
  constexpr std::size_t most = 16384;
  constexpr std::string_view between = ", ";
  for (std::size_t begin = 0; begin <= folders.size();) {
    const std::size_t end = std::min(folders.find(between, begin), folders.size());
    if (folders.compare(begin, end - begin, folder) == 0) return;
    begin = end + between.size();
  }
  if (folders.size() + folder.size() < most) folders.append(between).append(folder);
}

/// What a model is learned from, and how.
struct Lesson {
  std::vector<ImageSet> images;
  std::vector<LeftOut> left_out;  ///< sets that could not be opened
  std::unique_ptr<Model> former;  ///< that is updated
  std::unique_ptr<TrainingArchive> kept;
  std::vector<TrainingSet> sets;
  LearningOptions options;
};

Lesson new_lesson(const LearnOptions& options) {
  Lesson lesson;
  lesson.images = open_learned_sets(options.sets, options.learning, lesson.left_out);
  lesson.sets = all_views(lesson.images);
  lesson.options = learning_options(options.learning, lesson.images, options.sets);
  if (options.keep_views) lesson.options.kept_views = views_file(options.to);
  return lesson;
}

/// The kept views of options.update, what joins and what leaves.
Lesson next_lesson(const LearnOptions& options) {
  if (options.sets.empty() && options.remove.empty())
    throw ConfigError("--update: name a folder of image sets that join, or objects that leave with --remove");
  Lesson lesson;
  lesson.former = std::make_unique<Model>(load_model(options.update));
  lesson.kept = open_kept_views(views_file(options.update), *lesson.former);
  if (lesson.kept == nullptr)
    throw FileError(views_file(options.update),
                    "does not belong to " + options.update +
                        ", which was learned anew since; learn it from its image sets, with --keep-views");
  lesson.options = lesson.kept->options();
  lesson.options.former = lesson.former.get();
  if (!options.sets.empty()) {
    lesson.images = open_learned_sets(options.sets, options.learning, lesson.left_out);
    add_folder(lesson.options.image_sets, absolute_folder(options.sets));
  }
  lesson.sets = updated_sets(*lesson.kept, options.remove, lesson.images);
  if (lesson.sets.empty()) throw ConfigError("--remove: no object would be left");
  lesson.options.program_version = EIGENPOSE_VERSION;
  lesson.options.threads = options.learning.options.threads;
  lesson.options.memory_limit = memory_limit(options.learning);
  lesson.options.kept_views = views_file(options.to);
  return lesson;
}

/// An update whose sets cannot be used would only take objects away. @throws ConfigError naming the first set
/// that did not join.
void check_joined(const Lesson& lesson, const Model& model) {
  for (const ImageSet& set : lesson.images)
    if (std::ranges::find(model.objects, set.object(), &ModelObject::name) == model.objects.end())
      throw ConfigError("\"" + set.object() +
                        "\" cannot join: its views cannot be used; nothing was changed");
}

/// The service takes no other options than these. @throws UsageError naming the first that it does not take.
int run_learn_at_service(const LearnOptions& options, const CLI::App& command, const std::stop_token& stop) {
  const std::set<std::string> taken = {"help", "components", "objects", "socket", "json"};
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || option->get_lnames().empty()) continue;
    const std::string& name = option->get_lnames().front();
    if (!taken.contains(name))
      throw UsageError(
          "--" + name +
          " needs a folder of image sets; without one the running service learns as it is configured");
  }
  nlohmann::json body = nlohmann::json::object();
  if (command.count("--components") > 0) body["components"] = options.learning.options.solver.components;
  if (!options.learning.objects.empty()) body["objects"] = options.learning.objects;
  return learn_at_service(options.service, body, stop);
}

int run_learn(LearnOptions options, const CLI::App& command, const std::stop_token& stop) {
  const bool update = !options.update.empty();
  if (options.sets.empty() && !update) return run_learn_at_service(options, command, stop);
  if (options.service.json) throw UsageError("--json is for learning by the service, without a folder");
  if (options.sets.empty() && !options.learning.objects.empty())
    throw ConfigError(
        "--objects: it chooses from image sets, and none are given; --remove names objects that leave");
  if (options.to.empty()) options.to = options.update;
  if (options.to.empty()) throw UsageError("the model needs a name; add --to FILE");
  if (std::filesystem::path(options.to).extension() == ".views")
    throw ConfigError("--to: " + options.to +
                      " is a name of kept views; give the model another, as lab.model");
  { const AtomicFile writable(options.to); }  // said now, not when all is learned
  const FileLock alone(options.to + ".lock", "the model");
  Lesson lesson = update ? next_lesson(options) : new_lesson(options);
  const auto folder = std::filesystem::path(options.to).parent_path();
  if (options.learning.strict) lesson.options.bad_views = BadViews::refuse;
  lesson.options.scratch_folder = folder.empty() ? "." : folder;  // where there is room for the model
  ConsoleProgress progress;
  LearningReport report;
  const Model model = learn(lesson.sets, lesson.options, &report, progress.callback(), stop);
  progress.clear();
  print_left_out(lesson.left_out);
  print_left_out(report.left_out);
  if (update) check_joined(lesson, model);
  if (report.kept_views)
    save_with_views(model, options.to, *report.kept_views);
  else
    save_model(model, options.to);
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
  auto* keep = command->add_flag("--keep-views", options->keep_views,
                                 "Keep the views beside the model, so that objects can join and leave it");
  auto* update =
      command
          ->add_option("--update", options->update, "A model whose views were kept: the image sets join it")
          ->excludes(keep);
  command->add_option("--remove", options->remove, "Objects that leave the updated model, e.g. obj1,obj2")
      ->delimiter(',')
      ->needs(update);
  add_learning_options(*command, options->learning);
  command->add_flag("--strict", options->learning.strict,
                    "Refuse a view or a set that cannot be used, instead of leaving it out with a warning");
  for (const std::string& fixed : fixed_learning_options()) update->excludes(command->get_option(fixed));
  add_service_options(*command, options->service);
  command->callback([options, command, &line] {
    line.action = [options, command, &line] { return run_learn(*options, *command, line.stop); };
  });
}

}  // namespace eigenpose::cli
