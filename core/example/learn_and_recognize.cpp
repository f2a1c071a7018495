/// The library in one small program: learns image sets, keeps the model, says what is in pictures.
///
///     learn_and_recognize SETS MODEL PICTURE…

#include <cstdio>
#include <exception>
#include <memory>

#include "core/dataset/image_set.h"
#include "core/image/picture_file.h"
#include "core/learning/learning.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"

namespace {

using namespace eigenpose;

void learn_sets(const char* folder, const char* model_file) {
  const auto sets = open_image_sets(folder);
  LearningOptions options;
  options.normalization.size = 64;
  options.solver.components = 20;
  LearningReport report;
  const Model model = learn(all_views(sets), options, &report);
  save_model(model, model_file);
  std::printf("learned %zu objects from %zu views, %.0f %% of the scatter in %zu dimensions\n",
              model.objects.size(), report.views, 100.0 * report.solver.energy, report.solver.components);
}

void recognize_picture(Recognizer& recognizer, const char* file) {
  for (const Outcome& outcome : recognizer.recognize(load_picture(file))) {
    std::printf("%s: at %d,%d: %s", file, outcome.box.x, outcome.box.y,
                std::string(verdict_name(outcome.verdict)).c_str());
    if (outcome.verdict == Verdict::recognized)
      std::printf(" %s, turned by %.1f", outcome.best->object.c_str(), outcome.best->q[0]);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "learn_and_recognize SETS MODEL PICTURE...\n");
    return 2;
  }
  try {
    learn_sets(argv[1], argv[2]);
    Recognizer recognizer(std::make_shared<const Model>(load_model(argv[2])));
    for (int i = 3; i < argc; ++i) recognize_picture(recognizer, argv[i]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "learn_and_recognize: %s\n", error.what());
    return 1;
  }
  return 0;
}
