/// Frame to outcome, stage by stage, with the plain OpenCV pipeline as the peer in the same run.
///
/// 640×480 colour pictures with 1 to 4 of the learned objects (20 unless another number is given), 64×64 in
/// colour, 20 dimensions, one thread; first the whole-region match alone, then with windows and alignment, as
/// learned by default. Each picture is written just before, as a camera's conversion writes it. Thread CPU
/// time; p50 and p99 over frames. The peer does the same work as one would write it down: grey, threshold,
/// connected components with statistics, area resize, float, unit energy, subtract the mean, product, nearest
/// of 360 samples an object.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "core/learning/learning.h"
#include "core/recognition/recognizer.h"
#include "tests/bench/series.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using bench::Series;
using bench::thread_us;

constexpr int views = 36;
constexpr int frames = 400;
constexpr int samples_an_object = 360;

double us(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// Brightness, red against green, blue against both; the last two three times, as models have them.
const cv::Matx33f opponent_axes(0.577350F, 0.577350F, 0.577350F,  //
                                0.0F, -2.121320F, 2.121320F,      //
                                2.449490F, -1.224745F, -1.224745F);

/// The pipeline as OpenCV's functions give it.
class PlainPipeline {
 public:
  explicit PlainPipeline(const Model& model) : model_(model) {
    for (const ModelObject& object : model.objects)
      for (int s = 0; s < samples_an_object; ++s) {
        const std::vector<double> q{360.0 * s / samples_an_object};
        points_.push_back(object.manifold.evaluate(q).cast<float>());
      }
    samples_.resize(model.eigenspace.components(), static_cast<Eigen::Index>(points_.size()));
    for (std::size_t i = 0; i < points_.size(); ++i) samples_.col(static_cast<Eigen::Index>(i)) = points_[i];
  }

  std::size_t recognize(const cv::Mat& image) {
    cv::Mat grey;
    cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    cv::Mat mask;
    cv::threshold(grey, mask, 20, 255, cv::THRESH_BINARY);
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat middles;
    const int count = cv::connectedComponentsWithStats(mask, labels, stats, middles);
    std::size_t found = 0;
    for (int i = 1; i < count; ++i) {
      if (stats.at<int>(i, cv::CC_STAT_AREA) < 100) continue;
      const cv::Mat cut =
          image(cv::Rect(stats.at<int>(i, 0), stats.at<int>(i, 1), stats.at<int>(i, 2), stats.at<int>(i, 3)));
      cv::Mat square(std::max(cut.rows, cut.cols), std::max(cut.rows, cut.cols), CV_8UC3, cv::Scalar::all(0));
      cut.copyTo(
          square(cv::Rect((square.cols - cut.cols) / 2, (square.rows - cut.rows) / 2, cut.cols, cut.rows)));
      cv::Mat small;
      cv::resize(square, small, {64, 64}, 0, 0, cv::INTER_AREA);
      cv::Mat floats;
      small.convertTo(floats, CV_32F);
      cv::transform(floats, floats, opponent_axes);
      Eigen::Map<Eigen::VectorXf> x(reinterpret_cast<float*>(floats.data), model_.eigenspace.length());
      x.normalize();
      x -= model_.eigenspace.mean;
      const Eigen::VectorXf point = model_.eigenspace.basis.transpose() * x;
      Eigen::Index nearest = 0;
      (samples_.colwise() - point).colwise().squaredNorm().minCoeff(&nearest);
      found += nearest >= 0 ? 1 : 0;
    }
    return found;
  }

 private:
  const Model& model_;
  std::vector<Eigen::VectorXf> points_;
  Eigen::MatrixXf samples_;
};

/// The camera stands as far from the table when objects are learned as when they are recognised.
testing::SceneKnobs one_object() {
  return testing::SceneKnobs::centred(320, 240, 3.2);
}

std::vector<cv::Mat> make_frames(int objects) {
  std::vector<cv::Mat> result;
  for (int i = 0; i < frames; ++i) {
    testing::SceneKnobs knobs = one_object();
    knobs.width = 640;
    knobs.height = 480;
    cv::Mat frame = testing::empty_scene(knobs, i);
    const int count = 1 + i % 4;
    for (int c = 0; c < count; ++c) {
      knobs.x = c % 2 == 0 ? 160.0 : 480.0;
      knobs.y = c < 2 ? 120.0 : 360.0;
      testing::draw_object(frame, (i * 7 + c * 31) % objects, 3.7 * i + 90.0 * c, knobs);
    }
    result.push_back(std::move(frame));
  }
  return result;
}

void measure(std::span<const ImageSet> sets, const std::vector<cv::Mat>& pictures, bool parts) {
  LearningOptions options;
  options.parts = parts;
  LearningReport report;
  const auto model = std::make_shared<const Model>(learn(all_views(sets), options, &report));
  std::printf("\n%s\nlearned %zu views of %zu objects in %.1f s\n",
              parts ? "With windows and alignment (default)" : "Whole-region match alone", report.views,
              sets.size(), std::chrono::duration<double>(report.total_time).count());
  Recognizer recognizer(model);
  PlainPipeline plain(*model);
  Series segment("segment");
  Series normalize("normalise");
  Series project("project");
  Series search("search, judge, pose");
  Series total("total");
  Series peer("plain OpenCV");
  std::size_t outcomes = 0;
  std::size_t recognized = 0;
  cv::Mat picture;
  for (int pass = 0; pass < 2; ++pass)
    for (const cv::Mat& taken : pictures) {
      taken.copyTo(picture);  // the camera's conversion
      RecognitionTimes times;
      const double began = thread_us();
      const auto found = recognizer.recognize(picture, &times);
      const double spent = thread_us() - began;
      const double plain_began = thread_us();
      (void)plain.recognize(picture);
      const double plain_spent = thread_us() - plain_began;
      if (pass == 0) continue;  // warm up
      outcomes += found.size();
      for (const Outcome& outcome : found) recognized += outcome.verdict == Verdict::recognized ? 1 : 0;
      segment.add(us(times.segment));
      normalize.add(us(times.normalize));
      project.add(us(times.project));
      search.add(us(times.search));
      total.add(spent);
      peer.add(plain_spent);
    }
  std::printf("%d frames, %zu regions, %zu recognised; stages in wall time, totals in thread time:\n", frames,
              outcomes, recognized);
  for (Series* series : {&segment, &normalize, &project, &search, &total, &peer}) series->print();
  std::printf("  plain / ours: %.1f\n", peer.median() / total.median());
}

int run(int objects) {
  cv::setNumThreads(1);
  const test::TemporaryFolder folder;
  for (int o = 0; o < objects; ++o)
    testing::write_turn(folder.path(), "obj" + std::to_string(o), o, views, one_object());
  const auto sets = open_image_sets(folder.path());
  const std::vector<cv::Mat> pictures = make_frames(objects);
  measure(sets, pictures, false);
  measure(sets, pictures, true);
  return 0;
}

}  // namespace
}  // namespace eigenpose

int main(int argc, char** argv) {
  const int objects = argc > 1 ? std::atoi(argv[1]) : 20;
  if (objects < 2 || objects > 1000) {
    std::fprintf(stderr, "usage: frame_bench [OBJECTS from 2 to 1000]\n");
    return 2;
  }
  return eigenpose::run(objects);
}
