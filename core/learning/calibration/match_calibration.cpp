#include "core/learning/calibration/match_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/alignment/misalignment.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"
#include "core/manifold/sample_grid.h"
#include "core/recognition/aligned_match.h"
#include "core/search/search.h"

namespace eigenpose {
namespace {

/// A region within this many scales of an object needs no window to confirm it.
constexpr double sure_scales = 1.5;

/// Growth of the squared interpolation error when the step doubles, where it cannot be measured; and the
/// bounds of a measured growth: an error of the first power of the step gives at least 2, of the third
/// power 64.
constexpr double default_growth = 4.0;
constexpr double least_growth = 2.0;
constexpr double most_growth = 64.0;
/// Share of new views that show surfaces which were hidden one step before.
constexpr double sudden_share = 0.02;
/// Perturbed views that are enough for all objects together.
constexpr std::size_t most_for_match = 4000;
constexpr double most_sure_ratio = 0.3;
constexpr double sure_margin = 0.8;

/// Every second view is kept, every fourth, every eighth.
constexpr std::array<std::size_t, 3> thinnings{2, 4, 8};

/// What one perturbed view shows.
struct Probe {
  double full = 0.0;  ///< squared distance to its own manifold
  /// For each thinning, squared distance to the manifold of the kept views, minus `full`: the sum over the
  /// DOFs. −1: there are too few views.
  std::array<double, thinnings.size()> missed{};
  double other =
      std::numeric_limits<double>::infinity();  ///< distance to the nearest other object, aligned with it
};

/// An object's manifolds through some of its views: without the views at one value of a DOF, and with every
/// n-th other value only, those that are n/2 steps from it and so on.
class ThinnedManifolds {
 public:
  ThinnedManifolds(const ObjectViews& object, const Eigen::Ref<const Eigen::MatrixXd>& points, int degree)
      : object_(object), points_(points), degree_(degree) {}

  /// Squared distance to the manifold without value `from` of DOF `d`. Nothing where too few views are left.
  std::optional<double> squared_distance(std::size_t d, std::size_t every, std::size_t from,
                                         const Eigen::VectorXf& point);

 private:
  struct Thinned {
    std::unique_ptr<Manifold> manifold;
    std::unique_ptr<ManifoldSearch> search;
  };

  [[nodiscard]] Thinned thin(std::size_t d, std::size_t every, std::size_t from) const;
  [[nodiscard]] Thinned thin_scattered(std::size_t every, std::size_t from) const;

  const ObjectViews& object_;
  Eigen::Ref<const Eigen::MatrixXd> points_;
  int degree_;
  std::map<std::array<std::size_t, 3>, Thinned> made_;
};

/// Every n-th view of those that are no grid, in the order of their poses, but not `from`: each of its
/// neighbours is n/2 views away.
std::vector<Eigen::Index> thinned_views(std::size_t count, std::size_t every, std::size_t from) {
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < count; ++i)
    if ((i + every - from % every) % every == every / 2) kept.push_back(static_cast<Eigen::Index>(i));
  return kept;
}

/// Of few views only the one is left out.
bool too_few_to_thin(std::size_t values) {
  return values < 6;
}

ThinnedManifolds::Thinned ThinnedManifolds::thin_scattered(std::size_t every, std::size_t from) const {
  const std::vector<Eigen::Index> kept = thinned_views(object_.count, every, from);
  const Eigen::MatrixXd poses = object_.poses(Eigen::all, kept);
  if (kept.size() < 3 || !Manifold::undetermined_dof(object_.axes, poses).empty()) return {};
  Thinned result;
  result.manifold = std::make_unique<Manifold>(
      Manifold::fit(object_.axes, poses, points_(Eigen::all, kept), {.degree = degree_}));
  result.search = make_search("tree", {result.manifold.get(), 1});
  return result;
}

ThinnedManifolds::Thinned ThinnedManifolds::thin(std::size_t d, std::size_t every, std::size_t from) const {
  const std::vector<double>& all = object_.axes[d].samples;
  const bool closed = object_.axes[d].dof.periodic;
  const auto kept = [&](std::size_t i) {
    // The ends of an open DOF stay: beyond them there is no manifold.
    if (!closed && (i == 0 || i + 1 == all.size())) return true;
    return too_few_to_thin(all.size()) ? i != from : (i + every - from) % every == every / 2;
  };
  std::vector<SampleAxis> axes = object_.axes;
  axes[d].samples.clear();
  for (std::size_t i = 0; i < all.size(); ++i)
    if (kept(i)) axes[d].samples.push_back(all[i]);
  if (axes[d].samples.size() < 2) return {};
  const Grid grid = grid_of(object_.axes);
  std::vector<Eigen::Index> cells;
  for (std::size_t cell = 0; cell < object_.count; ++cell)
    if (kept(grid.index(cell, d))) cells.push_back(static_cast<Eigen::Index>(cell));
  Thinned result;
  result.manifold =
      std::make_unique<Manifold>(Manifold::interpolate(axes, points_(Eigen::all, cells), degree_));
  result.search = make_search("tree", {result.manifold.get(), 1});
  return result;
}

std::optional<double> ThinnedManifolds::squared_distance(std::size_t d, std::size_t every, std::size_t from,
                                                         const Eigen::VectorXf& point) {
  const bool scattered = object_.poses.size() > 0;
  const std::size_t values = scattered ? object_.count : object_.axes[d].samples.size();
  if (values < 3 || (every > 2 && values < 3 * every)) return std::nullopt;
  if (!scattered && !object_.axes[d].dof.periodic && (from == 0 || from + 1 == values)) return std::nullopt;
  // Values a whole number of thinned steps apart leave the same views.
  if (scattered || !too_few_to_thin(values)) from %= every;
  const std::array<std::size_t, 3> key{d, every, from};
  auto made = made_.find(key);
  if (made == made_.end())
    made = made_.emplace(key, scattered ? thin_scattered(every, from) : thin(d, every, from)).first;
  if (!made->second.search) return std::nullopt;
  std::array<ClosestPoint, 1> nearest;
  if (made->second.search->nearest_into(point, nearest) == 0) return std::nullopt;
  return nearest[0].distance * nearest[0].distance;
}

/// What all objects are measured with.
struct ProbeTask {
  const Model& model;
  const TrainingViews& views;
  const Eigen::MatrixXd& points;  ///< K × M, of all views
  const ManifoldSearch& all;
  const SeparateSearches& separate;
  const MatchCalibrationOptions& options;
  std::size_t copies = 1;
};

/// Interpolation error of the thinned manifolds at a view, one sum over the DOFs for each thinning; −1 where
/// there are too few views. @param full squared distance to the manifold through all views.
std::array<double, thinnings.size()> missed_at(ThinnedManifolds& thinned, const Grid& grid, std::size_t view,
                                               const Eigen::VectorXf& point, double full) {
  std::array<double, thinnings.size()> missed{};
  for (std::size_t t = 0; t < thinnings.size(); ++t)
    for (std::size_t d = 0; d < grid.axes() && missed[t] >= 0.0; ++d) {
      const auto squared = thinned.squared_distance(d, thinnings[t], grid.index(view, d), point);
      missed[t] = squared ? missed[t] + std::max(0.0, *squared - full) : -1.0;
    }
  return missed;
}

/// Perturbs, aligns and measures every view of one object.
std::vector<Probe> probe_object(const ProbeTask& task, std::size_t o) {
  const ObjectViews& object = task.views.objects()[o];
  const Eigen::MatrixXd points = task.points.middleCols(static_cast<Eigen::Index>(object.first),
                                                        static_cast<Eigen::Index>(object.count));
  // Views that are no grid are thinned once, over all DOFs together.
  const Grid grid = object.poses.size() > 0 ? Grid({object.count}) : grid_of(object.axes);
  ThinnedManifolds thinned(object, points, task.model.objects[o].manifold.degree());
  const NormalizationOptions& normalization = task.model.normalization;
  const int size = normalization.size;
  const int bands = picture_bands(normalization);

  AlignedMatch match(task.model, task.all, task.separate, std::numeric_limits<double>::infinity());
  SeededRandom random(static_cast<std::uint32_t>(o + 1));
  const std::size_t length = picture_length(normalization);
  std::vector<float> view(length);
  std::vector<float> moved(length);
  std::vector<std::uint8_t> bytes(length);
  PosePicture picture;
  std::vector<Probe> probes;
  for (std::size_t v = 0; v < object.count; ++v) {
    picture_numbers(task.views.picture(object.first + v), view);
    for (std::size_t copy = 0; copy < task.copies; ++copy) {
      undo_misalignment(view, size, bands, task.options.perturbation.draw(random), moved);
      quantize(moved, bytes);
      make_pose_picture(cv::Mat(size, size, CV_8UC(bands), bytes.data()), picture);
      const AlignedPose& pose = match.align(picture, o).front();
      const RealignedDistance distance = match.distance(moved, pose.misalignment, o);
      Probe probe;
      probe.full = distance.own * distance.own;
      probe.missed = missed_at(thinned, grid, v, match.point(), probe.full);
      if (distance.other) {
        const std::size_t other = distance.other->manifold;
        probe.other = match.distance(moved, match.align(picture, other).front().misalignment, other).own;
      }
      probes.push_back(probe);
    }
  }
  return probes;
}

/// By what factors the spline's squared error grows when the step doubles, over all objects.
struct Growth {
  double to_learned = default_growth;  ///< from the learned step to its double
  double to_half = default_growth;     ///< from there to the fourfold
};

Growth error_growth(const std::vector<std::vector<Probe>>& probes) {
  std::array<double, thinnings.size() - 1> growth{};
  for (std::size_t t = 0; t < growth.size(); ++t) {
    std::vector<double> fine;
    std::vector<double> coarse;
    for (const auto& object : probes)
      for (const Probe& probe : object)
        if (probe.missed[t] >= 0.0 && probe.missed[t + 1] >= 0.0) {
          fine.push_back(probe.missed[t]);
          coarse.push_back(probe.missed[t + 1]);
        }
    if (fine.empty()) continue;
    growth[t] =
        std::clamp(upper_median(coarse) / std::max(upper_median(fine), 1e-12), least_growth, most_growth);
  }
  if (growth[0] == 0.0) return {};
  // Coarse steps miss so much that doubling them hardly adds: growth itself grows towards finer ones.
  const double next = growth[1] == 0.0 ? growth[0] : growth[0] * growth[0] / growth[1];
  return {std::clamp(next, growth[0], most_growth), growth[0]};
}

/// The unit of an object's distances: their mean plus half the largest.
double scale_of(const std::vector<double>& distances) {
  return std::max(1e-6, mean(distances) + 0.5 * *std::ranges::max_element(distances));
}

/// What the probes of one object say, with the spline's error growing as over all objects.
MatchEvidence weigh(const std::vector<Probe>& probes, const Growth& growth) {
  std::vector<double> expected;
  std::vector<double> half;
  std::vector<double> quarter;
  double squares = 0.0;
  MatchEvidence result;
  for (const Probe& probe : probes) {
    const double missed = std::max(0.0, probe.missed[0]);
    // An upper estimate: the same growth as one halving before.
    const double fresh = probe.full + missed / growth.to_half;
    squares += fresh;
    expected.push_back(std::sqrt(fresh));
    result.learned.push_back(probe.full);
    if (probe.missed[0] >= 0.0) half.push_back(probe.missed[0]);
    if (probe.missed[1] >= 0.0) quarter.push_back(probe.missed[1]);
    result.others.push_back(probe.other);
    // If the view had not been learned, the other object would be the nearer one: such a ratio is no proof.
    const double left_out = probe.full + missed;
    if (probe.other * probe.other < left_out)
      result.false_lead = std::min(result.false_lead, probe.other * probe.other / left_out);
  }
  result.scale = scale_of(expected);
  result.typical_distance = std::sqrt(squares / static_cast<double>(probes.size()));
  // With too few views to thin, the distance of the learned views stands in.
  result.missed = half.empty() ? growth.to_learned * mean(result.learned) : mean(half);
  result.growth = growth.to_learned;
  const double mean_expected = quarter.empty() ? mean(half) : mean(quarter) / growth.to_half;
  for (const double missed : half) result.factors.push_back(missed / std::max(mean_expected, 1e-12));
  return result;
}

/// The distance that a share `rate` of an object's new views exceeds. @param factors of all objects, rising.
double exceeded_by(const MatchEvidence& own, const std::vector<double>& factors, double rate) {
  const auto all = static_cast<double>(own.learned.size() * factors.size());
  /// Share of the views whose squared distance exceeds this where the spline misses so much on average.
  const auto beyond = [&](double squared, double missed) {
    std::ptrdiff_t count = 0;
    for (const double learned : own.learned) {
      const double factor = (squared - learned) / std::max(missed, 1e-12);
      count += factors.end() - std::upper_bound(factors.begin(), factors.end(), factor);
    }
    return static_cast<double>(count) / all;
  };
  double low = 0.0;
  double high = *std::max_element(own.learned.begin(), own.learned.end()) + own.missed * factors.back();
  for (int halvings = 0; halvings < 40; ++halvings) {
    const double middle = 0.5 * (low + high);
    const double share = (1.0 - sudden_share) * beyond(middle, own.missed / own.growth) +
                         sudden_share * beyond(middle, own.missed);
    (share > rate ? low : high) = middle;
  }
  return std::sqrt(high);
}

}  // namespace

std::vector<MatchEvidence> measure_match(const Model& model, const TrainingViews& views,
                                         const Eigen::MatrixXd& points,
                                         const MatchCalibrationOptions& options, const Progress& progress,
                                         std::stop_token stop) {
  if (!(options.rate >= 0.0 && options.rate <= 0.5 && options.false_acceptance_rate >= 0.0 &&
        options.false_acceptance_rate <= 1.0))
    throw std::invalid_argument("the rate of false rejections is " + std::to_string(options.rate) +
                                ", allowed are 0 to 0.5; that of false acceptances is " +
                                std::to_string(options.false_acceptance_rate) + ", allowed are 0 to 1");
  if (options.copies < 1)
    throw std::invalid_argument("calibration needs at least one perturbed copy of every view, got 0");
  const std::size_t copies = std::clamp<std::size_t>(most_for_match / views.count(), 1, options.copies);
  std::vector<Manifold> manifolds;
  for (const ModelObject& object : model.objects) manifolds.push_back(object.manifold);
  const auto search = make_search("tree", manifolds);
  const SeparateSearches separate(manifolds);
  const ProbeTask task{model, views, points, *search, separate, options, copies};
  std::vector<std::vector<Probe>> probes(manifolds.size());
  WorkMeter meter(progress, std::move(stop), "calibrating alignment", manifolds.size());
  parallel_for(manifolds.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    probes[o] = probe_object(task, o);
    meter.finished(1);
  });
  const Growth growth = error_growth(probes);
  std::vector<MatchEvidence> evidence;
  evidence.reserve(probes.size());
  for (std::size_t o = 0; o < probes.size(); ++o) {
    evidence.push_back(weigh(probes[o], growth));
    evidence.back().views = views.objects()[o].count;
  }
  return evidence;
}

MatchThresholds match_thresholds(const std::vector<MatchEvidence>& evidence,
                                 const MatchCalibrationOptions& options, std::optional<std::size_t> without) {
  std::size_t views = 0;
  std::vector<double> factors;
  std::vector<double> others;
  MatchThresholds result;
  result.sure_ratio = most_sure_ratio;
  for (std::size_t o = 0; o < evidence.size(); ++o) {
    if (o == without) continue;
    const MatchEvidence& own = evidence[o];
    views += own.views;
    factors.insert(factors.end(), own.factors.begin(), own.factors.end());
    others.insert(others.end(), own.others.begin(), own.others.end());
    result.sure_ratio = std::min(result.sure_ratio, sure_margin * own.false_lead);
  }
  if (factors.empty()) factors.push_back(1.0);
  std::sort(factors.begin(), factors.end());
  std::sort(others.begin(), others.end());
  result.smallest_rate = 1.0 / (static_cast<double>(views) + 1.0);
  const double rate = std::max(options.rate, result.smallest_rate);
  const auto nearest =
      static_cast<std::size_t>(options.false_acceptance_rate * static_cast<double>(others.size()));
  const double cap = others[std::min(nearest, others.size() - 1)];
  for (std::size_t o = 0; o < evidence.size(); ++o) {
    const double scale = evidence[o].scale;
    const double known = o == without ? 0.0 : exceeded_by(evidence[o], factors, rate);
    const double rejection = std::min(known, std::max(cap, scale));
    result.rejection_distance.push_back(rejection);
    // Beyond the distance of unknown objects windows must confirm, whatever known views need.
    result.sure_distance.push_back(std::min({rejection, sure_scales * scale, cap}));
  }
  return result;
}

}  // namespace eigenpose
