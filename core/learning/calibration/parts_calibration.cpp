#include "core/learning/calibration/parts_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>

#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/base/parallel.h"

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

cv::Mat moved(const cv::Mat& picture, const PartsCalibrationOptions& options, std::mt19937& random) {
  std::uniform_real_distribution<double> each_way(-1.0, 1.0);
  const double n = picture.cols;
  const double scale = 1.0 + options.scale * each_way(random);
  const double turn = options.turn_deg * std::numbers::pi / 180.0 * each_way(random);
  const double cosine = scale * std::cos(turn);
  const double sine = scale * std::sin(turn);
  const double middle = 0.5 * n - 0.5;
  const double dx = options.shift * n * each_way(random);
  const double dy = options.shift * n * each_way(random);
  const cv::Matx23d map(cosine, -sine, middle + dx - cosine * middle + sine * middle, sine, cosine,
                        middle + dy - sine * middle - cosine * middle);
  cv::Mat out;
  cv::warpAffine(picture, out, map, picture.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

Scores score_views(const PartsModel& model, std::size_t object, const PartsViews& views,
                   const PartsCalibrationOptions& options, std::size_t stride) {
  OrientationGridMaker mapper(model.background);
  PartialMatcher matcher(model.objects, model.scale, model.voting);
  OrientationGrid map;
  QueryWindows windows;
  std::vector<float> votes;
  std::vector<float> likeness;
  std::vector<float> background;
  const PartsObject& parts = model.objects[object];
  // The same moves on every machine and with any number of threads.
  std::mt19937 random(static_cast<unsigned>(object) + 1U);
  Scores scores;
  for (std::size_t v = 0; v < views.count; v += stride) {
    mapper.compute(moved(views.view(v), options, random), map);
    make_query_windows(map, model.space, model.scale, model.voting, windows);
    matcher.match(windows, {&object, 1});
    matcher.plain_votes(windows, object, votes);
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
    matcher.window_likeness(object, static_cast<int>(next), likeness, background);
    const auto foreign =
        std::count_if(likeness.begin(), likeness.end(), [](float k) { return k < foreign_likeness; });
    scores.foreign.push_back(0.5 * static_cast<double>(foreign) / static_cast<double>(likeness.size()));
  }
  return scores;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
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
  const double ratio = median(std::move(second)) / std::max(median(std::move(first)), 1e-6);
  const double power = std::clamp(std::log2(std::max(ratio, 1.0)), 0.2, 1.0);
  return std::pow(0.5, power);
}

}  // namespace

void calibrate_parts(PartsModel& model, const std::vector<PartsViews>& objects,
                     const PartsCalibrationOptions& options, const Progress& progress, std::stop_token stop) {
  if (!(options.rate >= 0.0 && options.rate <= 0.5)) {
    throw std::invalid_argument("the rate of wrong rejections is " + std::to_string(options.rate) +
                                ", allowed are 0 to 0.5");
  }
  std::size_t views = 0;
  for (const PartsViews& object : objects) views += object.count;
  const std::size_t stride = (views + most_shown - 1) / most_shown;
  std::vector<Scores> scores(objects.size());
  parallel_for(objects.size(), options.threads, [&](std::size_t o) {
    if (stop.stop_requested()) {
      throw Interrupted();
    }
    scores[o] = score_views(model, o, objects[o], options, stride);
    if (progress && o % 8 == 0) {
      progress({"calibrating", o, objects.size()});
    }
  });
  const double share = half_step_share(scores);
  for (Scores& own : scores) {
    for (std::size_t v = 0; v < own.present.size(); ++v) {
      own.score.push_back(own.present[v] + share * (own.one_away[v] - own.present[v]));
    }
  }
  std::vector<double> deviations(objects.size());
  std::vector<double> pooled;
  for (std::size_t o = 0; o < objects.size(); ++o) {
    const auto& own = scores[o].score;
    const auto n = static_cast<double>(own.size());
    const double mean = std::accumulate(own.begin(), own.end(), 0.0) / n;
    double squared = 0.0;
    for (const double s : own) {
      squared += (s - mean) * (s - mean);
    }
    deviations[o] = std::max(least_deviation, std::sqrt(squared / n));
    for (const double s : own) {
      pooled.push_back((s - mean) / deviations[o]);
    }
    model.calibration[o].typical_score = mean;
    model.calibration[o].covered_share =
        std::clamp(*std::max_element(scores[o].foreign.begin(), scores[o].foreign.end()), least_covered_share,
                   most_covered_share);
  }
  std::sort(pooled.begin(), pooled.end(), std::greater<>());
  model.smallest_rate = 1.0 / static_cast<double>(pooled.size() + 1);
  const auto allowed = static_cast<std::size_t>(options.rate / model.smallest_rate);
  const double limit = pooled[std::min(allowed > 0 ? allowed - 1 : 0, pooled.size() - 1)];
  for (std::size_t o = 0; o < objects.size(); ++o) {
    PartsCalibration& own = model.calibration[o];
    own.rejection_score = own.typical_score + limit * deviations[o];
  }
}

}  // namespace eigenpose
