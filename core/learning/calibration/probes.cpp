#include "core/learning/calibration/probes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/work_meter.h"
#include "core/image/occlusion.h"
#include "core/learning/calibration/shown_view.h"
#include "core/recognition/parts_stage.h"

namespace eigenpose {
namespace {

/// A learned view, and what it is shown to beside the whole region's match.
struct View {
  std::size_t object = 0;
  std::size_t view = 0;
  bool windows = false;
  bool hidden = false;                ///< once more, with a part hidden
  const ShownProbes* kept = nullptr;  ///< what is known of it already; null: it is to be shown
};

/// A view that is known, halfway between learned ones.
WholeMatch known_match(const Model& model, const Yardsticks& yardsticks, std::size_t object,
                       std::size_t view) {
  return {std::sqrt(yardsticks.squared[object][view]), model.objects[object].typical_distance};
}

/// Shows views of one object after the other. One thread at a time.
class Prober {
 public:
  Prober(const Model& model, const ModelSearches& searches, const TrainingViews& views,
         const Yardsticks& yardsticks, const ProbeOptions& options)
      : model_(model), views_(views), yardsticks_(yardsticks), options_(options), shown_(model, searches) {
    if (model.parts) recognizer_.emplace(*model.parts, model.decision);
  }

  ShownProbes show(const View& view);

 private:
  [[nodiscard]] const std::string& name_of(const View& view) const {
    return views_.objects()[view.object].object;
  }
  [[nodiscard]] cv::Mat learned(const View& view) const {
    return views_.picture(views_.objects()[view.object].first + view.view);
  }
  [[nodiscard]] cv::Mat perturbed(const View& view) const {
    return eigenpose::perturbed(learned(view), yardsticks_.perturbation, name_of(view), view.view);
  }
  void show_known(const View& view, ShownProbes& shown);
  /// Its windows: sets what `probe` has of them.
  void show_known_windows(const View& view, const cv::Mat& picture, const PartsRecognizer::Look& look,
                          Probe& probe, ShownProbes& shown);
  /// What the colours of a new view there would show.
  [[nodiscard]] std::optional<ColorMatch> expected_colors(const PartsRecognizer::Look& look,
                                                          const View& view) const;
  /// Between what is seen with a view among the learned ones and without it: of a new view.
  [[nodiscard]] double halfway(double present, double left_out) const {
    return present + yardsticks_.half_step * (left_out - present);
  }
  void show_unknown(const View& view, ShownProbes& shown);
  void show_hidden(const View& view, ShownProbes& shown);
  /// Notes the two objects with most votes that are not the view's own.
  static void add_rivals(const PartsRecognizer::Votes& votes, ShownProbes& shown);
  /// The occluded match, where some of the windows are foreign.
  [[nodiscard]] std::optional<OccludedProbe> match_occluded(const PartsRecognizer::Votes& votes) const;
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

std::optional<OccludedProbe> Prober::match_occluded(const PartsRecognizer::Votes& votes) const {
  const auto found = identify_if_occluded(model_, votes);
  return found ? std::optional(OccludedProbe{found->best.object, found->match}) : std::nullopt;
}

void Prober::show_known(const View& view, ShownProbes& shown) {
  Probe probe{view.object, view.object, true};
  probe.whole = known_match(model_, yardsticks_, view.object, view.view);
  if (recognizer_) {
    const cv::Mat picture = perturbed(view);
    const PartsRecognizer::Look look = recognizer_->look(picture);
    probe.whole.color = expected_colors(look, view);
    if (view.windows) show_known_windows(view, picture, look, probe, shown);
  }
  shown.probes.push_back(probe);
}

std::optional<ColorMatch> Prober::expected_colors(const PartsRecognizer::Look& look, const View& view) const {
  std::optional<ColorMatch> color = look.color_match(view.object);
  if (!color) return color;
  const auto own_view = static_cast<int>(view.view);
  color->distance = halfway(color->distance, look.color_match(view.object, {&own_view, 1})->distance);
  return color;
}

void Prober::show_known_windows(const View& view, const cv::Mat& picture, const PartsRecognizer::Look& look,
                                Probe& probe, ShownProbes& shown) {
  shown_.show(picture);
  const PartsRecognizer::Votes all = look.vote();
  const WindowsMatch present = all.match(view.object);
  add_rivals(all, shown);
  const auto own_view = static_cast<int>(view.view);
  const WindowsMatch left_out = all.without(view.object, {&own_view, 1}).match(view.object);
  WindowsMatch expected = present;
  expected.votes = halfway(present.votes, left_out.votes);
  expected.discriminating = halfway(present.discriminating, left_out.discriminating);
  if (present.next && left_out.next) expected.next = halfway(*present.next, *left_out.next);
  const RealignedDistance distance = shown_.distance(view.object, std::nullopt);
  if (distance.other) {
    probe.whole.other = distance.other->distance;
    shown.rivals.push_back(distance.other->manifold);
  }
  probe.windows = {view.object, probe.whole, expected};
}

void Prober::show_unknown(const View& view, ShownProbes& shown) {
  // Misalignment makes an unknown object less like the learned ones: without it is the harder case.
  const cv::Mat picture = learned(view);
  shown_.show(picture);
  const auto nearest = shown_.nearest(view.object);
  if (!nearest) return;
  shown.rivals.push_back(*nearest);
  Probe probe{view.object, *nearest, false};
  if (!view.windows) {
    std::optional<ColorMatch> color;
    if (recognizer_) color = recognizer_->look(picture).color_match(*nearest);
    probe.whole = whole_match(model_, *nearest, shown_.distance(*nearest, view.object), color);
  } else {
    const PartsRecognizer::Look look = recognizer_->look(picture);
    const WholeRegion region{shown_.numbers(), view.object};
    const WholeCandidate aligned = align_whole(look, shown_.aligned_match(), region, *nearest);
    probe.whole = whole_match(model_, aligned);
    const PartsRecognizer::Votes votes = look.vote().without(view.object, all_views(view.object));
    add_rivals(votes, shown);
    const WholeCandidate best =
        compare_whole(model_, look, votes, shown_.aligned_match(), region, aligned).front();
    probe.windows = {best.object, whole_match(model_, best), best.windows};
    probe.occluded = match_occluded(votes);
  }
  shown.probes.push_back(probe);
}

void Prober::show_hidden(const View& view, ShownProbes& shown) {
  SeededRandom random(~seed_of(name_of(view), view.view));  // not the draws of its perturbation
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
    const PartsRecognizer::Votes votes = look.vote().without(view.object, absent);
    add_rivals(votes, shown);
    Probe probe{view.object, view.object, known, true};
    probe.occluded = match_occluded(votes);
    shown.probes.push_back(probe);
  }
}

void Prober::add_rivals(const PartsRecognizer::Votes& votes, ShownProbes& shown) {
  std::size_t added = 0;
  for (const PartialVote& vote : votes.ranked()) {
    if (vote.object == shown.object) continue;
    shown.rivals.push_back(vote.object);
    if (++added == 2) return;
  }
}

ShownProbes Prober::show(const View& view) {
  ShownProbes shown{view.object, view.view, view.windows, view.hidden, {}, {}};
  show_known(view, shown);
  show_unknown(view, shown);
  if (view.hidden) show_hidden(view, shown);
  std::ranges::sort(shown.rivals);
  shown.rivals.erase(std::unique(shown.rivals.begin(), shown.rivals.end()), shown.rivals.end());
  return shown;
}

void update_yardsticks(const Model& model, std::size_t object, WholeMatch& match) {
  match.typical = model.objects[object].typical_distance;
  if (match.color) match.color->typical = model.parts->calibration[object].typical_color;
}

/// Probes as they were, with the yardsticks as they are.
ShownProbes brought_up_to_date(const Model& model, const Yardsticks& yardsticks, ShownProbes shown) {
  for (Probe& probe : shown.probes) {
    update_yardsticks(model, probe.taken_for, probe.whole);
    if (probe.known && !probe.hidden)
      probe.whole.distance = known_match(model, yardsticks, shown.object, shown.view).distance;
    if (probe.occluded) {
      const PartsCalibration& calibration = model.parts->calibration[probe.occluded->taken_for];
      OccludedMatch& match = probe.occluded->match;
      match.windows.typical_votes = calibration.typical_votes;
      if (match.color) match.color->typical = calibration.typical_color;
    }
    if (!probe.windows) continue;
    const std::size_t taken_for = probe.windows->taken_for;
    if (probe.known) probe.windows->whole = probe.whole;
    update_yardsticks(model, taken_for, probe.windows->whole);
    probe.windows->windows.typical_votes = model.parts->calibration[taken_for].typical_votes;
  }
  return shown;
}

/// The views to show, and those that were shown before.
std::vector<View> choose_views(const Model& model, const TrainingViews& views, const ProbeOptions& options) {
  std::vector<View> chosen;
  // An even sample: view i is in it where the count of the sample rises.
  const auto sampled = [&](std::size_t i, std::size_t size) {
    return i * size / views.count() != (i + 1) * size / views.count() || size >= views.count();
  };
  const CalibrationRecord* kept = options.kept;
  for (std::size_t o = 0; o < views.objects().size(); ++o) {
    if (kept != nullptr && !kept->objects[o].misalignments.empty()) {
      for (const ShownProbes& shown : kept->shown)
        if (shown.object == o)
          chosen.push_back(
              {o, shown.view, shown.windows, shown.hidden, shown.probes.empty() ? nullptr : &shown});
      continue;
    }
    for (std::size_t v = 0; v < views.objects()[o].count; ++v) {
      const std::size_t i = views.objects()[o].first + v;
      const View view{o, v, model.parts && sampled(i, options.shown),
                      model.parts && sampled(i, options.hidden), nullptr};
      // Without windows, every view counts; with them, those that the windows see.
      if (!model.parts || view.windows || view.hidden || sampled(i, 4 * options.shown))
        chosen.push_back(view);
    }
  }
  return chosen;
}

}  // namespace

std::vector<ShownProbes> show_views(const Model& model, const TrainingViews& views,
                                    const Yardsticks& yardsticks, const ProbeOptions& options,
                                    const Progress& progress, const std::stop_token& stop) {
  const std::vector<View> chosen = choose_views(model, views, options);
  const ModelSearches searches(model);
  constexpr std::size_t batch = 16;
  std::vector<ShownProbes> result(chosen.size());
  WorkMeter meter(progress, stop, "showing views as new and as unknown", chosen.size());
  parallel_for((chosen.size() + batch - 1) / batch, options.threads, [&](std::size_t b) {
    std::optional<Prober> prober;
    for (std::size_t i = b * batch; i < std::min(chosen.size(), (b + 1) * batch); ++i) {
      meter.check_stop();
      const View& view = chosen[i];
      if (view.kept == nullptr && !prober) prober.emplace(model, searches, views, yardsticks, options);
      result[i] =
          view.kept != nullptr ? brought_up_to_date(model, yardsticks, *view.kept) : prober->show(view);
      meter.finished(1);
    }
  });
  return result;
}

std::vector<Probe> probes_of(std::span<const ShownProbes> shown) {
  std::vector<Probe> probes;
  for (const ShownProbes& view : shown) probes.insert(probes.end(), view.probes.begin(), view.probes.end());
  return probes;
}

}  // namespace eigenpose
