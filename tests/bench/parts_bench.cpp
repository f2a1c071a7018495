/// One region, as long as it takes: 100 drawn objects (unless another number is given) of 36 views, 64×64 in
/// colour, 20 dimensions, one thread.
///
///   settled     a view between the learned ones, moved a little: the whole region, aligned, settles it
///   shortlist   the same with a fifth covered: windows of ten objects vote, the pose is aligned around the
///   cover all         the same among all objects
///
/// Thread time; p50 and p99 over regions. Also learning's time, and the memory of a model's object.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/evaluation/evaluation.h"
#include "core/image/occlusion.h"
#include "core/learning/learning.h"
#include "core/recognition/parts_recognizer.h"
#include "core/recognition/recognizer.h"
#include "tests/bench/series.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

constexpr int views = 36;
constexpr int regions = 500;
constexpr std::size_t shortlist_length = 10;

/// An object that fills the picture, as a camera that stands still sees it.
testing::SceneKnobs close_up() {
  return testing::SceneKnobs::centred(160, 160, 2.0);
}

struct Region {
  std::size_t object = 0;
  cv::Mat scene;    ///< a picture of it, moved
  cv::Mat covered;  ///< normalised, a fifth hidden
};

std::vector<Region> make_regions(std::size_t objects, const NormalizationOptions& options) {
  std::mt19937 random(1);
  Segmenter segmenter(options.segmentation);
  Normalizer normalizer(options);
  std::vector<float> picture(normalizer.length());
  std::vector<Region> made;
  for (int i = 0; i < regions; ++i) {
    Region region;
    region.object = random() % objects;
    const double angle = 0.1 * static_cast<double>(random() % 3600);
    const TestDamage moved{.scale = 0.03, .rotation_deg = 3.0};
    region.scene = damaged(testing::scene_with(static_cast<int>(region.object), angle, close_up(), i), moved,
                           static_cast<std::size_t>(i));
    segmenter.segment(region.scene);
    normalizer.normalize(segmenter.cut_out(region.scene, 0), segmenter.background().level, picture);
    region.covered.create(options.size, options.size, CV_8UC3);
    quantize(picture, {region.covered.ptr<std::uint8_t>(), picture.size()});
    const auto share = [&] { return static_cast<double>(random()) / 4294967296.0; };
    hide_square(region.covered, 0.2, share(), share());
    made.push_back(std::move(region));
  }
  return made;
}

int run(std::size_t objects) {
  cv::setNumThreads(1);
  const test::TemporaryFolder folder;
  for (std::size_t o = 0; o < objects; ++o)
    testing::write_turn(folder.path(), "obj" + std::to_string(o), static_cast<int>(o), views, close_up());
  const auto sets = open_image_sets(folder.path());
  LearningOptions options;
  options.solver.components = 20;
  LearningReport report;
  const auto model = std::make_shared<const Model>(learn(all_views(sets), options, &report));
  double bytes = 0.0;
  for (std::size_t o = 0; o < objects; ++o) bytes += static_cast<double>(model->memory(o));
  std::printf("learned %zu views of %zu objects in %.1f s; %.2f MB an object\n", report.views, objects,
              std::chrono::duration<double>(report.total_time).count(),
              bytes / static_cast<double>(objects) / 1e6);

  bench::Series settled("settled, frame and all");
  bench::Series shortlist("windows of ten objects");
  bench::Series all("windows of all objects");
  Recognizer recognizer(model);
  PartsRecognizer windows(*model->parts, model->decision);
  std::size_t recognized = 0;
  std::size_t found[2] = {0, 0};
  for (const Region& region : make_regions(objects, model->normalization)) {
    double began = bench::thread_us();
    const auto outcomes = recognizer.recognize(region.scene);
    settled.add(bench::thread_us() - began);
    recognized += outcomes.size() == 1 && outcomes[0].verdict == Verdict::recognized ? 1 : 0;
    std::vector<std::size_t> names(shortlist_length);
    std::iota(names.begin(), names.end(), region.object);
    for (std::size_t& name : names) name %= objects;
    for (const bool among_all : {false, true}) {
      began = bench::thread_us();
      const PartsIdentification seen =
          windows.look(region.covered)
              .vote(among_all ? std::span<const std::size_t>() : std::span<const std::size_t>(names))
              .identify_occluded();
      (among_all ? all : shortlist).add(bench::thread_us() - began);
      const std::string& name = model->objects[seen.best.object].name;
      found[among_all ? 1 : 0] += name == "obj" + std::to_string(region.object) ? 1 : 0;
    }
  }
  std::printf(
      "%d regions: %zu recognised whole; covered, the right object in %zu (shortlist) and %zu (all)\n",
      regions, recognized, found[0], found[1]);
  settled.print();
  shortlist.print();
  all.print();
  return 0;
}

}  // namespace
}  // namespace eigenpose

int main(int argc, char** argv) {
  const int objects = argc > 1 ? std::atoi(argv[1]) : 100;
  if (objects < 10 || objects > 1000) {
    std::fprintf(stderr, "usage: parts_bench [OBJECTS from 10 to 1000]\n");
    return 2;
  }
  return eigenpose::run(static_cast<std::size_t>(objects));
}
