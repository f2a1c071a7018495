#include "core/evaluation/composed_scenes.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "core/base/random.h"
#include "core/image/foreground.h"
#include "core/image/region.h"

namespace eigenpose {
namespace {

constexpr int tries = 4000;          // places that are tried for an object
constexpr int apart = 12;            // pixels between objects that do not touch, or more
constexpr int least_touching = 8;    // pixels of an object beside another that it touches
constexpr double least_union = 0.5;  // a box is an object's where it shares so much of both boxes' union

cv::Mat grown(const cv::Mat& mask, int border) {
  cv::Mat out;
  cv::copyMakeBorder(mask, out, border, border, border, border, cv::BORDER_CONSTANT, cv::Scalar::all(0));
  cv::dilate(out, out, cv::Mat::ones(2 * border + 1, 2 * border + 1, CV_8U));
  return out;
}

}  // namespace

SceneComposer::SceneComposer(std::span<const ImageSet> sets, std::span<const SetView> views,
                             SceneOptions options, const SegmentationOptions& segmentation)
    : sets_(sets), views_(views), options_(options), segmenter_(segmentation) {
  if (views.empty()) throw std::invalid_argument("there is no view to compose scenes of");
  if (options.overlap && !(*options.overlap >= 0.0 && *options.overlap <= 0.9))
    throw std::invalid_argument("objects may cover 0 to 0.9 of each other, not " +
                                std::to_string(*options.overlap));
}

std::optional<SceneComposer::Cut> SceneComposer::cut(const SetView& shown) {
  const cv::Mat image = sets_[shown.set].load(shown.view);
  const auto regions = segmenter_.segment(image);
  const auto largest = std::ranges::max_element(regions, {}, [](const Region& r) { return r.box.area(); });
  if (largest == regions.end()) return std::nullopt;
  Cut cut;
  segmenter_.cut_out(image, static_cast<std::size_t>(largest - regions.begin())).copyTo(cut.pixels);
  cut.background = segmenter_.background().color();
  cut.mask = foreground_of(cut.pixels, segmenter_.background());
  // All within the outline is the object, however dark.
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(cut.mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(cut.mask, outlines, -1, cv::Scalar::all(255), cv::FILLED);
  return cut;
}

ComposedScene SceneComposer::compose(std::size_t index) {
  SeededRandom random(options_.seed * 1000003U + static_cast<unsigned>(index));
  const int wanted = 2 + random.below(3);
  std::vector<Cut> cuts;
  std::vector<SetView> shown;
  int largest = 0;
  for (int i = 0; i < wanted; ++i) {
    const SetView view = views_[static_cast<std::size_t>(random.below(static_cast<int>(views_.size())))];
    auto made = cut(view);
    if (!made) continue;
    if (!cuts.empty() && made->pixels.type() != cuts[0].pixels.type()) continue;
    largest = std::max({largest, made->mask.cols, made->mask.rows});
    cuts.push_back(std::move(*made));
    shown.push_back(view);
  }
  ComposedScene scene;
  if (cuts.empty()) return scene;
  const int margin = 2 * apart;
  const cv::Size size(5 * largest + 2 * margin, 4 * largest + 2 * margin);
  scene.picture = cv::Mat(size, cuts[0].pixels.type(), cuts[0].background);
  cv::Mat owner(size, CV_8U, cv::Scalar::all(0));  // which object a pixel shows, from 1; 0 none
  std::vector<int> areas;
  std::vector<int> covered;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    const cv::Mat& mask = cuts[i].mask;
    const int area = cv::countNonZero(mask);
    const bool touches = options_.overlap && !scene.objects.empty();
    const int border = touches ? 1 : apart;
    const cv::Mat around = grown(mask, border);
    for (int t = 0; t < tries; ++t) {
      const cv::Rect place(margin + random.below(size.width - mask.cols - 2 * margin + 1),
                           margin + random.below(size.height - mask.rows - 2 * margin + 1), mask.cols,
                           mask.rows);
      const cv::Rect outer(place.x - border, place.y - border, around.cols, around.rows);
      const cv::Mat near = owner(outer) & around;
      const int touching = cv::countNonZero(near);
      if (touches ? touching < least_touching : touching > 0) continue;
      // What stands there already goes behind.
      const cv::Mat behind = owner(place) & mask;
      std::vector<int> hidden(areas.size());
      bool too_much = false;
      for (std::size_t k = 0; k < areas.size() && touches; ++k) {
        hidden[k] = covered[k] + cv::countNonZero(behind == static_cast<int>(k + 1));
        too_much = too_much || hidden[k] > *options_.overlap * areas[k];
      }
      if (too_much) continue;
      if (touches) covered = hidden;
      cuts[i].pixels.copyTo(scene.picture(place), mask);
      owner(place).setTo(cv::Scalar::all(static_cast<double>(areas.size() + 1)), mask);
      areas.push_back(area);
      covered.push_back(0);
      scene.objects.push_back({shown[i], place});
      break;
    }
  }
  return scene;
}

void count_scene(const ComposedScene& scene, std::span<const ImageSet> sets,
                 std::span<const Outcome> outcomes, SceneReport& report) {
  ++report.scenes;
  report.objects += scene.objects.size();
  std::vector<bool> taken(outcomes.size(), false);
  for (const ComposedScene::Placed& placed : scene.objects) {
    std::optional<std::size_t> nearest;
    double most = least_union;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const double share = shared_area(placed.box, outcomes[i].box);
      if (taken[i] || share < most) continue;
      most = share;
      nearest = i;
    }
    if (!nearest) continue;
    taken[*nearest] = true;
    ++report.found;
    const Outcome& outcome = outcomes[*nearest];
    const ImageSet& set = sets[placed.shown.set];
    if (!outcome.best || outcome.best->object != set.object()) continue;
    ++report.right;
    if (outcome.verdict == Verdict::recognized) ++report.recognized;
    report.pose_errors.push_back(std::abs(
        set.workspace()[0].difference(outcome.best->q.front(), set.views()[placed.shown.view].q.front())));
  }
  report.extra += static_cast<std::size_t>(std::ranges::count(taken, false));
}

}  // namespace eigenpose
