#include "core/learning/calibration/parts_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"

namespace eigenpose {
namespace {

constexpr double least_covered_share = 0.05;
constexpr double most_covered_share = 0.3;
constexpr std::size_t most_shown = 3000;  // views of all objects: more are told by a part of them
constexpr double least_deviation = 0.02;  // of scores: a few views cannot show that all are alike

/// Scores of one object's views.
struct Scores {
  std::vector<double> present;   ///< with the view itself among the learned ones
  std::vector<double> one_away;  ///< nearest learned view one step away
  std::vector<double> two_away;  ///< two steps away
  std::vector<double> score;     ///< what a new view is expected to have
  std::vector<double> foreign;
};

Scores score_views(const PartsModel& model, std::size_t object, const PartsViews& views,
                   const PartsCalibrationOptions& options, std::size_t stride) {
  OrientationGridMaker mapper(model.background);
  const std::span<const PartsObject> alone(&model.objects[object], 1);
  PartialMatcher matcher(alone, model.scale, model.voting);
  constexpr std::array<std::size_t, 1> shortlist{0};
  OrientationGrid map;
  QueryWindows windows;
  std::vector<float> votes;
  std::vector<float> likeness;
  std::vector<float> background;
  const PartsObject& parts = model.objects[object];
  // One sequence an object: the same with any number of threads.
  SeededRandom random(static_cast<std::uint32_t>(object) + 1U);
  Scores scores;
  for (std::size_t v = 0; v < views.count; v += stride) {
    mapper.compute(displaced(views.view(v), options.residual.draw(random)), map);
    make_query_windows(map, model.space, model.scale, model.voting, windows);
    matcher.match(windows, shortlist);
    matcher.plain_votes(0, votes);
    std::array<float, 3> most{};  // votes of views at least 0, 1 and 2 steps away
    std::size_t next = 0;
    const auto& near = parts.neighbours[v];
    for (std::size_t c = 0; c < votes.size(); ++c) {
      if (parts.candidates[c].mirrored) {
        continue;
      }
      most[0] = std::max(most[0], votes[c]);
      if (c == v) {
        continue;
      }
      if (votes[c] > most[1]) {
        most[1] = votes[c];
        next = c;
      }
      if (static_cast<int>(c) != near[0] && static_cast<int>(c) != near[1]) {
        most[2] = std::max(most[2], votes[c]);
      }
    }
    const auto score = [&](float part) { return 1.0 - static_cast<double>(part / windows.total_weight); };
    scores.present.push_back(score(most[0]));
    scores.one_away.push_back(score(most[1]));
    scores.two_away.push_back(score(most[2]));
    matcher.window_likeness(0, static_cast<int>(next), likeness, background);
    const auto foreign =
        std::count_if(likeness.begin(), likeness.end(), [](float k) { return k < foreign_likeness; });
    scores.foreign.push_back(0.5 * static_cast<double>(foreign) / static_cast<double>(likeness.size()));
  }
  return scores;
}

/// Share of the way from the score of a present view to that of one a whole step away which half a step
/// makes, by the power law through present views, one step and two steps.
double half_step_share(const std::vector<Scores>& scores) {
  std::vector<double> first;
  std::vector<double> second;
  for (const Scores& own : scores) {
    for (std::size_t v = 0; v < own.present.size(); ++v) {
      first.push_back(own.one_away[v] - own.present[v]);
      second.push_back(own.two_away[v] - own.present[v]);
    }
  }
  const double ratio = upper_median(second) / std::max(upper_median(first), 1e-6);
  const double power = std::clamp(std::log2(std::max(ratio, 1.0)), 0.2, 1.0);
  return std::pow(0.5, power);
}

/// Standardises the scores for each object, pools them and reads the thresholds off.
void set_thresholds(PartsModel& model, const std::vector<Scores>& scores, double rate) {
  std::vector<double> deviations;
  std::vector<double> pooled;
  for (std::size_t o = 0; o < scores.size(); ++o) {
    const std::vector<double>& own = scores[o].score;
    const double typical = mean(own);
    std::vector<double> centred;
    for (const double score : own) centred.push_back(score - typical);
    deviations.push_back(std::max(least_deviation, root_mean_square(centred)));
    for (const double difference : centred) pooled.push_back(difference / deviations[o]);
    model.calibration[o].typical_score = typical;
    model.calibration[o].covered_share =
        std::clamp(*std::ranges::max_element(scores[o].foreign), least_covered_share, most_covered_share);
  }
  std::sort(pooled.begin(), pooled.end(), std::greater<>());
  model.smallest_rate = 1.0 / static_cast<double>(pooled.size() + 1);
  const auto allowed = static_cast<std::size_t>(rate / model.smallest_rate);
  const double limit = pooled[std::min(allowed > 0 ? allowed - 1 : 0, pooled.size() - 1)];
  for (std::size_t o = 0; o < scores.size(); ++o)
    model.calibration[o].rejection_score = model.calibration[o].typical_score + limit * deviations[o];
}

}  // namespace

void calibrate_parts(PartsModel& model, const std::vector<PartsViews>& objects,
                     const PartsCalibrationOptions& options, const Progress& progress, std::stop_token stop) {
  if (!(options.rate >= 0.0 && options.rate <= 0.5)) {
    throw std::invalid_argument("the rate of false rejections is " + std::to_string(options.rate) +
                                ", allowed are 0 to 0.5");
  }
  std::size_t views = 0;
  for (const PartsViews& object : objects) views += object.count;
  const std::size_t stride = (views + most_shown - 1) / most_shown;
  std::vector<Scores> scores(objects.size());
  WorkMeter meter(progress, std::move(stop), "calibrating windows", objects.size());
  parallel_for(objects.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    scores[o] = score_views(model, o, objects[o], options, stride);
    meter.finished(1);
  });
  const double share = half_step_share(scores);
  for (Scores& own : scores)
    for (std::size_t v = 0; v < own.present.size(); ++v)
      own.score.push_back(own.present[v] + share * (own.one_away[v] - own.present[v]));
  set_thresholds(model, scores, options.rate);
}

}  // namespace eigenpose
