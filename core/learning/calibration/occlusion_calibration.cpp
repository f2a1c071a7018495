#include "core/learning/calibration/occlusion_calibration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/work_meter.h"
#include "core/image/occlusion.h"
#include "core/recognition/decision.h"
#include "core/recognition/parts_recognizer.h"

namespace eigenpose {
namespace {

/// The threshold is at least this: a few unknown views may contain none that looks like an occluded object.
constexpr double least_evidence = 4.0;
/// Share of a view that is hidden in its second showing: less of an occluded region can contradict a wrong
/// name.
constexpr double hidden_share = 0.2;

/// A learned view.
struct View {
  std::size_t object;
  std::size_t view;
};

/// Shows one view to all objects but its own, as it is and with a part hidden at a place drawn from `seed`.
OcclusionEvidence show_as_unknown(PartsRecognizer& recognizer, const PartsModel& model,
                                  const std::vector<PartsViews>& objects, const View& view,
                                  std::uint32_t seed) {
  std::vector<std::size_t> others;
  for (std::size_t o = 0; o < objects.size(); ++o)
    if (o != view.object) others.push_back(o);
  OcclusionEvidence most{view.object, view.object, -std::numeric_limits<double>::infinity()};
  for (const double hidden : {0.0, hidden_share}) {
    cv::Mat picture = objects[view.object].view(view.view).clone();
    if (hidden > 0.0) {
      SeededRandom random(seed);
      const double across = random.unit();
      const double down = random.unit();
      hide_square(picture, hidden, across, down);
    }
    const PartsIdentification found = recognizer.look(picture).identify(others);
    const PartsAnswer& best = found.best;
    if (best.occluded > model.calibration[best.object].covered_share && best.occluded <= max_occluded_share &&
        found.evidence > most.evidence)
      most = {view.object, best.object, found.evidence};
  }
  return most;
}

}  // namespace

std::vector<OcclusionEvidence> measure_occlusion(const PartsModel& model,
                                                 const std::vector<PartsViews>& objects,
                                                 const OcclusionCalibrationOptions& options,
                                                 const Progress& progress, std::stop_token stop) {
  if (objects.size() < 2) return {};
  std::vector<View> all;
  for (std::size_t o = 0; o < objects.size(); ++o)
    for (std::size_t v = 0; v < objects[o].count; ++v) all.push_back({o, v});
  const std::size_t shown = std::min(options.views, all.size());
  std::vector<OcclusionEvidence> result(shown);
  constexpr std::size_t batch = 16;
  WorkMeter meter(progress, std::move(stop), "calibrating occlusion", shown);
  parallel_for((shown + batch - 1) / batch, options.threads, [&](std::size_t b) {
    PartsRecognizer recognizer(model);
    for (std::size_t i = b * batch; i < std::min(shown, (b + 1) * batch); ++i) {
      meter.check_stop();
      result[i] = show_as_unknown(recognizer, model, objects, all[i * all.size() / shown],
                                  static_cast<std::uint32_t>(i));
      meter.finished(1);
    }
  });
  return result;
}

double occlusion_threshold(std::span<const OcclusionEvidence> unknown, double false_acceptance_rate,
                           std::optional<std::size_t> without) {
  std::vector<double> evidence;
  for (const OcclusionEvidence& shown : unknown)
    if (shown.object != without && shown.taken_for != without) evidence.push_back(shown.evidence);
  if (evidence.empty()) return std::numeric_limits<double>::infinity();
  std::sort(evidence.begin(), evidence.end(), std::greater<>());
  // Conformal: a new unknown view exceeds the k-th largest of n with probability k/(n + 1) at most.
  const auto rank =
      static_cast<std::size_t>(false_acceptance_rate * static_cast<double>(evidence.size() + 1));
  return std::max(least_evidence, evidence[std::min(std::max<std::size_t>(rank, 1), evidence.size()) - 1]);
}

}  // namespace eigenpose
