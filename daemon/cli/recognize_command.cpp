/// `eigenpose recognize`: what is in a picture.

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/outcome_json.h"
#include "daemon/cli/recognizer_options.h"

namespace eigenpose::cli {
namespace {

constexpr const char* recognize_examples = R"(
Every object in a picture gets one line: where it is, which object, its pose, and how sure that is. A picture given to a
model learned from cropped views is taken whole.

Examples:
  eigenpose recognize photo.png --model lab.model
  eigenpose recognize *.png --model lab.model --json)";

struct RecognizeOptions {
  std::vector<std::string> images;
  std::string model;
  RecognizerOptions recognizer;
  bool as_json = false;
};

/// "12.3 deg ±0.4"
std::string pose_text(const Outcome& outcome, const Model& model) {
  std::string text;
  for (const ModelObject& object : model.objects) {
    if (object.name != outcome.best->object) continue;
    for (std::size_t d = 0; d < outcome.best->q.size(); ++d) {
      char value[96];
      const Dof& dof = object.workspace[d];
      const double sigma = d < outcome.q_sigma.size() ? outcome.q_sigma[d] : INFINITY;
      if (std::isfinite(sigma))
        std::snprintf(value, sizeof value, "%s %.1f %s ±%.1f", dof.name.c_str(), outcome.best->q[d],
                      dof.unit.c_str(), sigma);
      else
        std::snprintf(value, sizeof value, "%s not to be seen", dof.name.c_str());
      text += (text.empty() ? "" : ", ") + std::string(value);
    }
  }
  return text;
}

void print(const Outcome& outcome, const Model& model) {
  const std::string verdict(verdict_name(outcome.verdict));
  std::printf("  %4d,%-4d %4dx%-4d  %-14s ", outcome.box.x, outcome.box.y, outcome.box.width,
              outcome.box.height, verdict.c_str());
  if (!outcome.best) {
    std::printf("\n");
    return;
  }
  if (outcome.verdict == Verdict::unknown)
    std::printf("nearest: %s, distance %.3f, allowed %.3f\n", outcome.best->object.c_str(),
                outcome.best->distance, outcome.rejection_distance);
  else
    std::printf(
        "%s  %s  distance %.3f, confidence %.2f%s%s\n", outcome.best->object.c_str(),
        pose_text(outcome, model).c_str(), outcome.best->distance, outcome.confidence,
        outcome.verdict == Verdict::ambiguous && outcome.runner_up ? ", or " : "",
        outcome.verdict == Verdict::ambiguous && outcome.runner_up ? outcome.runner_up->object.c_str() : "");
}

int run_recognize(const RecognizeOptions& options, const std::stop_token& stop) {
  const auto model = std::make_shared<const Model>(load_model(options.model));
  Recognizer recognizer(model, options.recognizer);
  nlohmann::json all = nlohmann::json::array();
  for (const std::string& name : options.images) {
    if (stop.stop_requested()) throw Interrupted();
    const cv::Mat image = load_picture(name);
    std::span<const Outcome> outcomes;
    try {
      outcomes = recognizer.recognize(image);
    } catch (const std::invalid_argument& wrong) {
      throw FileError(name, wrong.what());
    }
    if (options.as_json) {
      nlohmann::json list = nlohmann::json::array();
      for (const Outcome& outcome : outcomes) list.push_back(to_json(outcome, *model));
      all.push_back({{"image", name}, {"outcomes", list}});
      continue;
    }
    std::printf("%s%s\n", name.c_str(), outcomes.empty() ? ": nothing there" : "");
    for (const Outcome& outcome : outcomes) print(outcome, *model);
  }
  if (options.as_json) std::printf("%s\n", all.dump(2).c_str());
  return exit_done;
}

}  // namespace

void add_recognize_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<RecognizeOptions>();
  CLI::App* command =
      app.add_subcommand("recognize", "Say which objects are in pictures, and how they are turned");
  command->footer(recognize_examples);
  command->add_option("images", options->images, "Pictures: PNG, JPEG, PGM, PPM")->required();
  command->add_option("--model", options->model, "The model file")->required();
  add_recognizer_options(*command, options->recognizer);
  command->add_flag("--json", options->as_json, "Print the outcomes as JSON");
  command->callback(
      [options, &line] { line.action = [options, &line] { return run_recognize(*options, line.stop); }; });
}

}  // namespace eigenpose::cli
