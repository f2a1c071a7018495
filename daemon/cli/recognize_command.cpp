/// `eigenpose recognize`: what is in a picture.

#include <cstdio>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/printable.h"
#include "core/image/picture_file.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"
#include "daemon/api/json/outcome_json.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/outcome_text.h"
#include "daemon/cli/recognizer_options.h"

namespace eigenpose::cli {
namespace {

constexpr const char* recognize_examples = R"(
Every object in a picture gets one line: where it is, which object, its pose, and how sure that is. A picture given to a
model learned from cropped views is taken whole. A picture that cannot be read is named on stderr, with --json also in
its place in the list ("error"); the others are answered, and the exit code is 1.

Examples:
  eigenpose recognize photo.png --model lab.model
  eigenpose recognize *.png --model lab.model --json)";

struct RecognizeOptions {
  std::vector<std::string> images;
  std::string model;
  RecognizerOptions recognizer;
  bool as_json = false;
};

void print(const Outcome& outcome, const Model& model) {
  std::printf("  %4d,%-4d %4dx%-4d  %s\n", outcome.box.x, outcome.box.y, outcome.box.width,
              outcome.box.height, outcome_text(outcome_json(outcome, model)).c_str());
}

/// Prints the answers, picture by picture.
class Answers {
 public:
  Answers(const Model& model, bool as_json) : model_(model), as_json_(as_json) {}

  void outcomes(const std::string& picture, std::span<const Outcome> outcomes) {
    if (as_json_) {
      nlohmann::json list = nlohmann::json::array();
      for (const Outcome& outcome : outcomes) list.push_back(outcome_json(outcome, model_));
      element({{"image", picture}, {"outcomes", list}});
      return;
    }
    std::printf("%s%s\n", printable(picture).c_str(), outcomes.empty() ? ": nothing there" : "");
    for (const Outcome& outcome : outcomes) print(outcome, model_);
  }

  void failure(const std::string& picture, const std::string& what) {
    ++failed_;
    if (as_json_) element({{"image", picture}, {"error", what}});
    warn(what);
  }

  /// Ends the list. @return what the shell gets.
  int end() {
    if (as_json_) std::printf(count_ == 0 ? "[]\n" : "\n]\n");
    return failed_ == 0 ? exit_done : exit_failed;
  }

 private:
  void element(const nlohmann::json& value) {
    // A name that is not UTF-8 gets U+FFFD where it is not: JSON knows nothing else.
    std::printf("%s%s", count_++ == 0 ? "[\n" : ",\n",
                value.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  }

  const Model& model_;
  bool as_json_;
  std::size_t count_ = 0;
  std::size_t failed_ = 0;
};

int run_recognize(const RecognizeOptions& options, const std::stop_token& stop) {
  const auto model = std::make_shared<const Model>(load_model(options.model));
  Recognizer recognizer(model, options.recognizer);
  Answers answers(*model, options.as_json);
  for (const std::string& name : options.images) {
    if (stop.stop_requested()) {
      (void)answers.end();
      throw Interrupted();
    }
    try {
      const cv::Mat image = load_picture(name);
      if (model->normalization.color && image.channels() == 1)
        throw FileError(name,
                        "is a grey picture, and the model compares colour; learn one with --grey for it");
      answers.outcomes(name, recognizer.recognize(image));
    } catch (const FileError& wrong) {
      answers.failure(name, wrong.what());
    } catch (const std::invalid_argument& wrong) {
      answers.failure(name, FileError(name, wrong.what()).what());
    }
  }
  return answers.end();
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
