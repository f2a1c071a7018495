#include "core/learning/calibration/yardsticks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/parallel.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"
#include "core/learning/calibration/shown_view.h"
#include "core/learning/calibration/thinned_manifolds.h"
#include "core/manifold/sample_grid.h"

namespace eigenpose {
namespace {

constexpr double least_foreign_share = 0.05;
constexpr double most_foreign_share = 0.3;
constexpr std::size_t most_scored = 3000;  // views of all objects: of more, a part is measured

/// One view compared with its own object.
struct ViewDistance {
  double full = 0.0;  ///< squared, to the manifold through all views
  MissedErrors missed{};
};

/// What is measured of all objects, and one of them.
struct Measured {
  const Model& model;
  const ModelSearches& searches;
  const TrainingViews& views;
  const Eigen::MatrixXd& points;
  const YardstickOptions& options;
};

/// The distances of the views of object o. @param record its misalignments are used, or made where it has
/// none.
std::vector<ViewDistance> measure_object(const Measured& all, std::size_t o, ObjectRecord& record) {
  const auto& [model, searches, views, points, options] = all;
  const ObjectViews& object = views.objects()[o];
  const Eigen::MatrixXd own =
      points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count));
  // Views that are no grid are thinned once, over all DOFs together.
  const Grid grid = object.poses.size() > 0 ? Grid({object.count}) : grid_of(object.axes);
  ThinnedManifolds thinned(object, own, model.objects[o].manifold.degree());
  ShownView shown(model, searches);
  std::vector<ViewDistance> result;
  const bool aligned = record.misalignments.size() == object.count;
  for (std::size_t v = 0; v < object.count; ++v) {
    shown.show(perturbed(views.picture(object.first + v), options.perturbation, object.object, v));
    const double distance =
        (aligned ? shown.distance_at(record.misalignments[v], o) : shown.distance(o, std::nullopt)).own;
    if (!aligned && model.parts) record.misalignments.push_back(shown.misalignment());
    ViewDistance view{distance * distance};
    view.missed = missed_at(thinned, grid, v, shown.compared_point(), view.full);
    result.push_back(view);
  }
  return result;
}

/// Distances of the colours of one view, as a map of its picture, to all views and to the others.
std::array<double, 2> color_distances(const ColorViews& colors, const ChromaticityMap& map,
                                      std::size_t view) {
  const ChromaticityRoots roots = chromaticity_roots(map);
  const auto own = static_cast<int>(view);
  return {colors.distance(roots), colors.distance(roots, {&own, 1})};
}

VotesOfViews vote_for_own_views(const PartsModel& model, const TrainingViews& views, std::size_t o,
                                const YardstickOptions& options, std::size_t stride) {
  const ObjectViews& object = views.objects()[o];
  const PartsObject& parts = model.objects[o];
  OrientationGridMaker mapper(model.background);
  PartialMatcher matcher({&parts, 1}, model.scale, model.voting);
  constexpr std::array<std::size_t, 1> shortlist{0};
  OrientationGrid map;
  QueryWindows windows;
  std::vector<float> votes;
  std::vector<float> likeness;
  std::vector<float> background;
  VotesOfViews result;
  for (std::size_t v = 0; v < object.count; v += stride) {
    const cv::Mat picture = perturbed(views.picture(object.first + v), options.residual, object.object, v);
    if (!model.colors.empty())
      result.colors.push_back(
          color_distances(model.colors[o], chromaticity_map(picture, model.background), v));
    mapper.compute(picture, map);
    make_query_windows(map, model.space, model.scale, model.voting, windows);
    matcher.match(windows, shortlist);
    matcher.plain_votes(0, votes);
    std::array<double, 3> most{};
    std::size_t next = 0;
    const auto& near = parts.neighbours[v];
    for (std::size_t c = 0; c < votes.size(); ++c) {
      if (parts.candidates[c].mirrored) continue;
      const double share = static_cast<double>(votes[c] / windows.total_weight);
      most[0] = std::max(most[0], share);
      if (c == v) continue;
      if (share > most[1]) next = c;
      most[1] = std::max(most[1], share);
      if (static_cast<int>(c) != near[0] && static_cast<int>(c) != near[1])
        most[2] = std::max(most[2], share);
    }
    result.votes.push_back(most);
    matcher.window_likeness(0, static_cast<int>(next), likeness, background);
    const auto foreign =
        std::count_if(likeness.begin(), likeness.end(), [](float k) { return k < foreign_likeness; });
    result.foreign =
        std::max(result.foreign, 0.5 * static_cast<double>(foreign) / static_cast<double>(likeness.size()));
  }
  return result;
}

/// Share of the way from the votes of a present view to those of one a whole step away which half a step
/// makes, by the power law through present views, one step and two steps.
double half_step_share(const std::vector<ObjectRecord>& objects) {
  std::vector<double> first;
  std::vector<double> second;
  for (const ObjectRecord& own : objects)
    for (const auto& [present, one_away, two_away] : own.votes.votes) {
      first.push_back(present - one_away);
      second.push_back(present - two_away);
    }
  const double ratio = upper_median(second) / std::max(upper_median(first), 1e-6);
  const double power = std::clamp(std::log2(std::max(ratio, 1.0)), 0.2, 1.0);
  return std::pow(0.5, power);
}

void measure_windows(const PartsModel& parts, const TrainingViews& views, const YardstickOptions& options,
                     const Progress& progress, const std::stop_token& stop, Yardsticks& yardsticks) {
  const std::size_t stride = (views.count() + most_scored - 1) / most_scored;
  std::vector<ObjectRecord>& objects = yardsticks.records;
  WorkMeter meter(progress, stop, "calibrating windows", objects.size());
  parallel_for(objects.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    const std::size_t voting = (views.objects()[o].count + stride - 1) / stride;
    if (objects[o].votes.votes.size() != voting ||
        (!parts.colors.empty() && objects[o].votes.colors.size() != voting))
      objects[o].votes = vote_for_own_views(parts, views, o, options, stride);
    meter.finished(1);
  });
  yardsticks.half_step = half_step_share(objects);
  for (const ObjectRecord& own : objects) {
    const auto expected = [&](const auto& measured) {
      std::vector<double> halfway;
      halfway.reserve(measured.size());
      for (const auto& one : measured) halfway.push_back(one[0] + yardsticks.half_step * (one[1] - one[0]));
      return halfway.empty() ? 0.0 : mean(halfway);
    };
    yardsticks.windows.push_back({expected(own.votes.votes),
                                  std::clamp(own.votes.foreign, least_foreign_share, most_foreign_share),
                                  expected(own.votes.colors)});
  }
}

}  // namespace

Yardsticks measure_yardsticks(const Model& model, const TrainingViews& views, const Eigen::MatrixXd& points,
                              const YardstickOptions& options, const Progress& progress,
                              const std::stop_token& stop) {
  const std::size_t count = views.objects().size();
  const ModelSearches searches(model);
  std::vector<std::vector<ViewDistance>> distances(count);
  Yardsticks result;
  result.records.assign(options.kept.begin(), options.kept.end());
  result.records.resize(count);
  WorkMeter meter(progress, stop, "calibrating distances", count);
  parallel_for(count, options.threads, [&](std::size_t o) {
    meter.check_stop();
    distances[o] = measure_object({model, searches, views, points, options}, o, result.records[o]);
    meter.finished(1);
  });
  std::vector<MissedErrors> missed;
  for (const auto& own : distances)
    for (const ViewDistance& view : own) missed.push_back(view.missed);
  const double growth = error_growth(missed);
  result.perturbation = options.perturbation;
  for (const auto& own : distances) {
    std::vector<double> squared;
    squared.reserve(own.size());
    for (const ViewDistance& view : own)
      squared.push_back(view.full + std::max(0.0, view.missed[0]) / growth);
    result.typical_distance.push_back(std::sqrt(mean(squared)));
    result.squared.push_back(std::move(squared));
  }
  if (model.parts) measure_windows(*model.parts, views, options, progress, stop, result);
  return result;
}

}  // namespace eigenpose
