/// An object that joins 20, and one that leaves, beside learning anew: drawn objects of 36 views, 64×64 in
/// colour, with windows. Prints processor time of each and its ratio to that of learning 21 objects anew in
/// the same run.

#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "core/learning/learning.h"
#include "core/learning/training_archive.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

constexpr int objects = 20;
constexpr int views = 36;

double processor_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

struct Learned {
  Model model;
  double seconds = 0.0;
};

Learned timed(const std::vector<TrainingSet>& sets, const LearningOptions& options) {
  const double began = processor_seconds();
  Model model = learn(sets, options);
  return {std::move(model), processor_seconds() - began};
}

int run() {
  const test::TemporaryFolder folder;
  const auto write = [&](const char* below, int kind) {
    testing::write_turn(folder.path() / below, "obj" + std::to_string(kind), kind, views);
  };
  for (int kind = 1; kind <= objects; ++kind) write("old", kind);
  write("new", objects + 1);
  const auto old = open_image_sets(folder.path() / "old");
  const auto joining = open_image_sets(folder.path() / "new");
  LearningOptions options;
  options.normalization.size = 64;
  options.normalization.color = true;
  options.kept_views = folder.path() / "views";
  const Learned former = timed(all_views(old), options);

  const TrainingArchive kept(options.kept_views);
  LearningOptions update = kept.options();
  update.former = &former.model;
  update.kept_views = folder.path() / "next";
  const std::vector<std::string> leaving{"obj7"};
  const double joined = timed(updated_sets(kept, {}, joining), update).seconds;
  const double left = timed(updated_sets(kept, leaving, {}), update).seconds;

  std::vector<ImageSet> all = old;
  all.insert(all.end(), joining.begin(), joining.end());
  const double anew = timed(all_views(all), options).seconds;
  std::printf("%-24s %8s %8s\n", "processor time", "s", "ratio");
  std::printf("%-24s %8.2f %8.3f\n", "21 learned anew", anew, 1.0);
  std::printf("%-24s %8.2f %8.3f\n", "one joins 20", joined, joined / anew);
  std::printf("%-24s %8.2f %8.3f\n", "one leaves 20", left, left / anew);
  return 0;
}

}  // namespace
}  // namespace eigenpose

int main() {
  return eigenpose::run();
}
