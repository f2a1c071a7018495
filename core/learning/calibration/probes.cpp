#include "core/learning/calibration/probes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/work_meter.h"
#include "core/image/occlusion.h"
#include "core/learning/calibration/shown_view.h"
#include "core/recognition/parts_stage.h"

namespace eigenpose {
namespace {

/// A learned view.
struct View {
  std::size_t object;
  std::size_t view;
};

/// Shows views of one object after the other. One thread at a time.
class Prober {
 public:
  Prober(const Model& model, const ModelSearches& searches, const TrainingViews& views,
         const Yardsticks& yardsticks, const ProbeOptions& options)
      : model_(model), views_(views), yardsticks_(yardsticks), options_(options), shown_(model, searches) {
    if (model.parts) recognizer_.emplace(*model.parts, model.decision);
  }

  /// To the whole region's match, and to the windows where asked for.
  enum class To { whole, windows };
  void show(const View& view, To to, std::vector<Probe>& probes);
  void show_hidden(const View& view, std::vector<Probe>& probes);

 private:
  [[nodiscard]] cv::Mat learned(const View& view) const {
    return views_.picture(views_.objects()[view.object].first + view.view);
  }
  [[nodiscard]] cv::Mat perturbed(const View& view) const {
    return displaced(learned(view), perturbation_of(yardsticks_.perturbation, view.object, view.view));
  }
  [[nodiscard]] Probe known_probe(const View& view) const;
  void show_known(const View& view, const cv::Mat& picture, Probe& probe);
  void show_unknown(const View& view, To to, std::vector<Probe>& probes);
  /// The occluded match, where some of the windows are foreign.
  [[nodiscard]] std::optional<OccludedMatch> match_occluded(const PartsRecognizer::Votes& votes) const;
  /// The views of an object, all of them.
  [[nodiscard]] std::vector<int> all_views(std::size_t object) const;

  const Model& model_;
  const TrainingViews& views_;
  const Yardsticks& yardsticks_;
  const ProbeOptions& options_;
  ShownView shown_;
  std::optional<PartsRecognizer> recognizer_;
};

std::vector<int> Prober::all_views(std::size_t object) const {
  std::vector<int> all(views_.objects()[object].count);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

Probe Prober::known_probe(const View& view) const {
  Probe probe{view.object, view.object, true};
  probe.whole = {std::sqrt(yardsticks_.squared[view.object][view.view]),
                 model_.objects[view.object].typical_distance};
  return probe;
}

std::optional<OccludedMatch> Prober::match_occluded(const PartsRecognizer::Votes& votes) const {
  const auto found = identify_if_occluded(model_, votes);
  return found ? std::optional(found->match) : std::nullopt;
}

void Prober::show_known(const View& view, const cv::Mat& picture, Probe& probe) {
  const PartsRecognizer::Look look = recognizer_->look(picture);
  const PartsRecognizer::Votes all = look.vote();
  const WindowsMatch present = all.match(view.object);
  const auto own_view = static_cast<int>(view.view);
  const WindowsMatch left_out = all.without(view.object, {&own_view, 1}).match(view.object);
  const auto between = [&](double a, double b) { return a + yardsticks_.half_step * (b - a); };
  WindowsMatch expected = present;
  expected.votes = between(present.votes, left_out.votes);
  expected.discriminating = between(present.discriminating, left_out.discriminating);
  if (present.next && left_out.next) expected.next = between(*present.next, *left_out.next);
  const RealignedDistance distance = shown_.distance(view.object, std::nullopt);
  if (distance.other) probe.whole.other = distance.other->distance;
  probe.windows = {view.object, probe.whole, expected};
}

void Prober::show_unknown(const View& view, To to, std::vector<Probe>& probes) {
  // Misalignment makes an unknown object less like the learned ones: without it is the harder case.
  const cv::Mat picture = learned(view);
  shown_.show(picture);
  const auto nearest = shown_.nearest(view.object);
  if (!nearest) return;
  Probe probe{view.object, *nearest, false};
  if (to == To::whole) {
    probe.whole = whole_match(model_, *nearest, shown_.distance(*nearest, view.object));
  } else {
    const PartsRecognizer::Look look = recognizer_->look(picture);
    const WholeRegion region{shown_.numbers(), view.object};
    const WholeCandidate aligned = align_whole(look, shown_.aligned_match(), region, *nearest);
    probe.whole = whole_match(model_, *nearest, aligned.distance);
    const PartsRecognizer::Votes votes = look.vote().without(view.object, all_views(view.object));
    const WholeCandidate best =
        compare_whole(model_, look, votes, shown_.aligned_match(), region, aligned).front();
    probe.windows = {best.object, whole_match(model_, best.object, best.distance), best.windows};
    probe.occluded = match_occluded(votes);
  }
  probes.push_back(probe);
}

void Prober::show(const View& view, To to, std::vector<Probe>& probes) {
  const cv::Mat as_new = perturbed(view);
  shown_.show(as_new);
  Probe known = known_probe(view);
  if (to == To::windows) show_known(view, as_new, known);
  probes.push_back(known);
  show_unknown(view, to, probes);
}

void Prober::show_hidden(const View& view, std::vector<Probe>& probes) {
  SeededRandom random(static_cast<std::uint32_t>(view.object * 104729U + view.view + 1U));
  const double across = random.unit();
  const double down = random.unit();
  const auto own_view = static_cast<int>(view.view);
  const std::vector<int> all = all_views(view.object);
  for (const bool known : {true, false}) {
    if (!known && model_.objects.size() < 2) return;
    cv::Mat picture = known ? perturbed(view) : learned(view).clone();
    hide_square(picture, options_.hidden_share, across, down);
    const PartsRecognizer::Look look = recognizer_->look(picture);
    const std::span<const int> absent = known ? std::span(&own_view, 1) : std::span<const int>(all);
    Probe probe{view.object, view.object, known, true};
    probe.occluded = match_occluded(look.vote().without(view.object, absent));
    if (probe.occluded) probes.push_back(probe);
  }
}

}  // namespace

std::vector<Probe> show_views(const Model& model, const TrainingViews& views, const Yardsticks& yardsticks,
                              const ProbeOptions& options, const Progress& progress,
                              const std::stop_token& stop) {
  std::vector<View> all;
  for (std::size_t o = 0; o < views.objects().size(); ++o)
    for (std::size_t v = 0; v < views.objects()[o].count; ++v) all.push_back({o, v});
  // An even sample: view i is in it where the count of the sample rises.
  const auto sampled = [&](std::size_t i, std::size_t size) {
    return i * size / all.size() != (i + 1) * size / all.size() || size >= all.size();
  };
  const ModelSearches searches(model);
  constexpr std::size_t batch = 16;
  std::vector<std::vector<Probe>> probes((all.size() + batch - 1) / batch);
  WorkMeter meter(progress, stop, "showing views as new and as unknown", all.size());
  parallel_for(probes.size(), options.threads, [&](std::size_t b) {
    Prober prober(model, searches, views, yardsticks, options);
    for (std::size_t i = b * batch; i < std::min(all.size(), (b + 1) * batch); ++i) {
      meter.check_stop();
      const bool windows = model.parts && sampled(i, options.shown);
      // Without windows, every view counts; with them, those that the windows see.
      if (!model.parts || windows || sampled(i, 4 * options.shown))
        prober.show(all[i], windows ? Prober::To::windows : Prober::To::whole, probes[b]);
      if (model.parts && sampled(i, options.hidden)) prober.show_hidden(all[i], probes[b]);
      meter.finished(1);
    }
  });
  std::vector<Probe> result;
  for (const auto& some : probes) result.insert(result.end(), some.begin(), some.end());
  return result;
}

}  // namespace eigenpose
