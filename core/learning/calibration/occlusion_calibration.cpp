#include "core/learning/calibration/occlusion_calibration.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/image/occlusion.h"
#include "core/recognition/decision.h"
#include "core/recognition/parts_recognizer.h"

namespace eigenpose {
namespace {

/// Few strangers may show nothing that would be taken for a covered object; so much is asked for all the
/// same.
constexpr double least_evidence = 4.0;

constexpr double hidden_share = 0.2;

}  // namespace

std::vector<OcclusionEvidence> measure_occlusion(const PartsModel& model,
                                                 const std::vector<PartsViews>& objects,
                                                 const OcclusionCalibrationOptions& options,
                                                 const Progress& progress, std::stop_token stop) {
  if (objects.size() < 2) return {};
  struct View {
    std::size_t object;
    std::size_t view;
  };
  std::vector<View> all;
  for (std::size_t o = 0; o < objects.size(); ++o)
    for (std::size_t v = 0; v < objects[o].count; ++v) all.push_back({o, v});
  const std::size_t shown = std::min(options.views, all.size());
  std::vector<OcclusionEvidence> result(shown);
  constexpr std::size_t batch = 16;
  std::atomic<std::size_t> done = 0;
  parallel_for((shown + batch - 1) / batch, options.threads, [&](std::size_t b) {
    PartsRecognizer recognizer(model);
    std::vector<std::size_t> others;
    cv::Mat picture;
    for (std::size_t i = b * batch; i < std::min(shown, (b + 1) * batch); ++i) {
      if (stop.stop_requested()) throw Interrupted();
      const View& view = all[i * all.size() / shown];
      others.clear();
      for (std::size_t o = 0; o < objects.size(); ++o)
        if (o != view.object) others.push_back(o);
      // A stranger that is covered itself has less to tell it by.
      result[i] = {view.object, view.object, -std::numeric_limits<double>::infinity()};
      for (const bool covered : {false, true}) {
        objects[view.object].view(view.view).copyTo(picture);
        if (covered) {
          std::mt19937 random(static_cast<std::uint32_t>(i));  // the same squares on every machine
          const double across = static_cast<double>(random()) / 4294967296.0;
          const double down = static_cast<double>(random()) / 4294967296.0;
          hide_square(picture, hidden_share, across, down);
        }
        recognizer.look(picture);
        const PartsIdentification found = recognizer.identify(others);
        if (found.best.covered > model.calibration[found.best.object].covered_share &&
            found.best.covered <= max_occluded_share && found.evidence > result[i].evidence)
          result[i] = {view.object, found.best.object, found.evidence};
      }
    }
    done += batch;
    if (progress) progress({"calibrating covers", std::min(done.load(), shown), shown});
  });
  return result;
}

double occlusion_threshold(std::span<const OcclusionEvidence> strangers, double stranger_rate,
                           std::optional<std::size_t> without) {
  std::vector<double> evidence;
  for (const OcclusionEvidence& shown : strangers)
    if (shown.stranger != without && shown.taken_for != without) evidence.push_back(shown.evidence);
  if (evidence.empty()) return std::numeric_limits<double>::infinity();
  std::sort(evidence.begin(), evidence.end(), std::greater<>());
  // Conformal: a new stranger exceeds the k-th largest of n with probability k/(n + 1) at most.
  const auto rank = static_cast<std::size_t>(stranger_rate * static_cast<double>(evidence.size() + 1));
  return std::max(least_evidence, evidence[std::min(std::max<std::size_t>(rank, 1), evidence.size()) - 1]);
}

}  // namespace eigenpose
