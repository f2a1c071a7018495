#include "core/recognition/match_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/manifold/search.h"
#include "core/parts/misalignment.h"
#include "core/recognition/aligned_match.h"

namespace eigenpose {
namespace {

/// A distance of so many scales of its object leaves no doubt; beyond, windows must agree.
constexpr double sure_scales = 1.5;

/// Error² of a spline grows by this much when the step doubles, where it can't be measured; and the bounds
/// within which a measured growth is believed: the first power of the step, and the third.
constexpr double default_growth = 4.0;
constexpr double least_growth = 2.0;
constexpr double most_growth = 64.0;
/// With too few views to be left out, thresholds stand this much above what the views themselves show.
constexpr double unmeasured_margin = 1.5;
constexpr double most_sure_ratio = 0.3;
constexpr double sure_margin = 0.8;

/// What one moved view shows.
struct Probe {
  double full = 0.0;  ///< squared distance to its own manifold
  std::vector<double>
      half;  ///< for each DOF: squared, without every second view, minus `full`; −1: too few views
  std::vector<double> quarter;  ///< for each DOF: the same with every fourth view only
  double other =
      std::numeric_limits<double>::infinity();  ///< distance to the nearest other object, aligned with it
};

/// The object's manifold without the views at value `from` of DOF `d`: through every `every`-th value only,
/// those that are every/2 steps from it and so on. Nothing where too few are left.
std::optional<Manifold> thinned(const ObjectViews& object, const Eigen::Ref<const Eigen::MatrixXd>& points,
                                std::size_t d, std::size_t every, std::size_t from, int degree) {
  const std::vector<double>& all = object.axes[d].samples;
  const bool closed = object.axes[d].dof.periodic;
  // Of few views only the one is left out.
  const bool few = all.size() < 6;
  if (all.size() < 3 || (every > 2 && all.size() < 3 * every)) return std::nullopt;
  // The ends of an open DOF stay: beyond them there is no manifold.
  if (!closed && (from == 0 || from + 1 == all.size())) return std::nullopt;
  const auto kept = [&](std::size_t i) {
    if (!closed && (i == 0 || i + 1 == all.size())) return true;
    return few ? i != from : (i + all.size() * every - from) % every == every / 2;
  };
  std::vector<SampleAxis> axes = object.axes;
  axes[d].samples.clear();
  for (std::size_t i = 0; i < all.size(); ++i)
    if (kept(i)) axes[d].samples.push_back(all[i]);
  if (axes[d].samples.size() < 2) return std::nullopt;
  std::size_t inner = 1;
  for (std::size_t a = d + 1; a < object.axes.size(); ++a) inner *= object.axes[a].samples.size();
  std::vector<Eigen::Index> cells;
  for (std::size_t cell = 0; cell < object.count; ++cell)
    if (kept(cell / inner % all.size())) cells.push_back(static_cast<Eigen::Index>(cell));
  return Manifold::interpolate(axes, points(Eigen::all, cells), degree);
}

Misalignment random_misalignment(const MatchCalibrationOptions& options, std::mt19937& random) {
  // std::uniform_real_distribution differs between libraries; the generator does not.
  const auto each_way = [&] { return static_cast<double>(random()) / 2147483648.0 - 1.0; };
  Misalignment m;
  m.dx = options.shift * each_way();
  m.dy = options.shift * each_way();
  m.scale = options.scale * each_way();
  m.rotation = options.turn_deg * std::numbers::pi / 180.0 * each_way();
  return m;
}

double squared_distance(const Manifold& manifold, const Eigen::VectorXf& point) {
  const double distance = make_search("tree", {&manifold, 1})->nearest(point, 1).front().distance;
  return distance * distance;
}

/// Moves, aligns and measures every view of one object.
std::vector<Probe> probe_object(const Model& model, const ViewStore& views, const Eigen::MatrixXd& all_points,
                                std::size_t o, const ManifoldSearch& search,
                                const MatchCalibrationOptions& options) {
  const ObjectViews& object = views.objects()[o];
  const Eigen::MatrixXd points =
      all_points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count));
  const int degree = model.objects[o].manifold.degree();
  const int size = model.normalization.size;
  const int bands = picture_bands(model.normalization);
  const std::size_t dofs = object.axes.size();

  AlignedMatch match(model, search, std::numeric_limits<double>::infinity());
  std::mt19937 random(static_cast<std::uint32_t>(o + 1));
  const std::size_t length = picture_length(model.normalization);
  std::vector<float> view(length);
  std::vector<float> moved(length);
  std::vector<std::uint8_t> bytes(length);
  PosePicture picture;
  std::vector<Probe> probes;
  for (std::size_t v = 0; v < object.count; ++v) {
    picture_numbers(views.picture(object.first + v), view);
    for (std::size_t copy = 0; copy < options.moved_views; ++copy) {
      undo_misalignment(view, size, bands, random_misalignment(options, random), moved);
      quantize(moved, bytes);
      make_pose_picture(cv::Mat(size, size, CV_8UC(bands), bytes.data()), picture);
      const AlignedPose& pose = match.align(picture, o).front();
      const RealignedDistance distance = match.distance(moved, pose.misalignment, o);
      Probe probe;
      probe.full = distance.own * distance.own;
      const std::size_t other = distance.other ? distance.other->manifold : o;
      std::size_t inner = object.count;
      for (std::size_t d = 0; d < dofs; ++d) {
        const std::size_t n = object.axes[d].samples.size();
        inner /= n;
        const std::size_t value = v / inner % n;
        const auto measure = [&](std::size_t every) {
          const auto manifold = thinned(object, points, d, every, value, degree);
          return manifold ? std::max(0.0, squared_distance(*manifold, match.point()) - probe.full) : -1.0;
        };
        probe.half.push_back(measure(2));
        probe.quarter.push_back(measure(4));
      }
      if (other != o)
        probe.other = match.distance(moved, match.align(picture, other).front().misalignment, other).own;
      probes.push_back(std::move(probe));
    }
  }
  return probes;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// By what factor the spline's squared error grows when the step doubles, over all objects.
double error_growth(const std::vector<std::vector<Probe>>& probes) {
  std::vector<double> half;
  std::vector<double> quarter;
  for (const auto& object : probes)
    for (const Probe& probe : object)
      for (std::size_t d = 0; d < probe.half.size(); ++d)
        if (probe.half[d] >= 0.0 && probe.quarter[d] >= 0.0) {
          half.push_back(probe.half[d]);
          quarter.push_back(probe.quarter[d]);
        }
  if (half.empty()) return default_growth;
  return std::clamp(median(quarter) / std::max(median(half), 1e-12), least_growth, most_growth);
}

/// The length that an object's distances are measured in: their mean and their largest tell it together.
double scale_of(const std::vector<double>& distances) {
  const double sum = std::accumulate(distances.begin(), distances.end(), 0.0);
  return std::max(1e-6, sum / static_cast<double>(distances.size()) +
                            0.5 * *std::max_element(distances.begin(), distances.end()));
}

/// What the probes of one object say, with the spline's error growing as over all objects.
MatchEvidence weigh(const std::vector<Probe>& probes, double growth) {
  // What a new view is expected to have; and what one between views twice as far apart has, expected from
  // those four times as far apart, and found.
  std::vector<double> expected;
  std::vector<double> expected_half;
  std::vector<double> found_half;
  double squares = 0.0;
  MatchEvidence result;
  for (const Probe& probe : probes) {
    double fresh = probe.full;
    double half = probe.full;
    double coarse = probe.full;
    bool measured = true;
    for (std::size_t d = 0; d < probe.half.size(); ++d) {
      fresh += std::max(0.0, probe.half[d]) / growth;
      half += std::max(0.0, probe.half[d]);
      coarse += std::max(0.0, probe.quarter[d]) / growth;
      measured = measured && probe.half[d] >= 0.0 && probe.quarter[d] >= 0.0;
    }
    squares += fresh;
    expected.push_back(std::sqrt(fresh));
    if (measured) {
      expected_half.push_back(std::sqrt(coarse));
      found_half.push_back(std::sqrt(half));
    }
    result.others.push_back(probe.other);
    // Had the view not been learned, another object would have been nearer: such a lead must not count.
    if (probe.other * probe.other < half)
      result.false_lead = std::min(result.false_lead, probe.other * probe.other / half);
  }
  result.scale = scale_of(expected);
  result.typical_distance = std::sqrt(squares / static_cast<double>(probes.size()));
  if (found_half.empty()) {
    for (const double distance : expected)
      result.scores.push_back(unmeasured_margin * distance / result.scale);
  } else {
    const double scale = scale_of(expected_half);
    for (const double distance : found_half) result.scores.push_back(distance / scale);
  }
  return result;
}

}  // namespace

std::vector<MatchEvidence> measure_match(const Model& model, const ViewStore& views,
                                         const Eigen::MatrixXd& points,
                                         const MatchCalibrationOptions& options, const Progress& progress,
                                         std::stop_token stop) {
  if (!(options.rate >= 0.0 && options.rate <= 0.5 && options.stranger_rate >= 0.0 &&
        options.stranger_rate <= 1.0))
    throw std::invalid_argument("the rate of wrong rejections is " + std::to_string(options.rate) +
                                ", allowed are 0 to 0.5; that of accepted strangers is " +
                                std::to_string(options.stranger_rate) + ", allowed are 0 to 1");
  if (options.moved_views < 1) throw std::invalid_argument("calibration needs at least one moved view");
  std::vector<Manifold> manifolds;
  for (const ModelObject& object : model.objects) manifolds.push_back(object.manifold);
  const auto search = make_search("tree", manifolds);
  std::vector<std::vector<Probe>> probes(manifolds.size());
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(manifolds.size(), options.threads, [&](std::size_t o) {
    if (stop.stop_requested()) throw Interrupted();
    probes[o] = probe_object(model, views, points, o, *search, options);
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"calibrating", ++done, manifolds.size()});
  });
  const double growth = error_growth(probes);
  std::vector<MatchEvidence> evidence;
  evidence.reserve(probes.size());
  for (const auto& own : probes) evidence.push_back(weigh(own, growth));
  return evidence;
}

MatchThresholds match_thresholds(const std::vector<MatchEvidence>& evidence,
                                 const MatchCalibrationOptions& options, std::optional<std::size_t> without) {
  std::vector<double> scores;
  std::vector<double> others;
  MatchThresholds result;
  result.sure_ratio = most_sure_ratio;
  for (std::size_t o = 0; o < evidence.size(); ++o) {
    if (o == without) continue;
    const MatchEvidence& own = evidence[o];
    scores.insert(scores.end(), own.scores.begin(), own.scores.end());
    others.insert(others.end(), own.others.begin(), own.others.end());
    result.sure_ratio = std::min(result.sure_ratio, sure_margin * own.false_lead);
  }
  std::sort(scores.begin(), scores.end(), std::greater<>());
  std::sort(others.begin(), others.end());
  const std::size_t views = scores.size() / options.moved_views;
  result.smallest_rate = 1.0 / (static_cast<double>(views) + 1.0);
  const double rate = std::max(options.rate, result.smallest_rate);
  const auto rank = static_cast<std::size_t>(rate * (static_cast<double>(scores.size()) + 1.0));
  const double limit = scores[std::min(rank > 0 ? rank - 1 : 0, scores.size() - 1)];
  const auto nearest = static_cast<std::size_t>(options.stranger_rate * static_cast<double>(others.size()));
  const double cap = others[std::min(nearest, others.size() - 1)];
  for (std::size_t o = 0; o < evidence.size(); ++o) {
    const double scale = evidence[o].scale;
    const double rejection = o == without ? 0.0 : std::max(std::min(limit * scale, cap), scale);
    result.rejection_distance.push_back(rejection);
    // As near as strangers come, windows are asked, however far known views may be.
    result.sure_distance.push_back(std::min({rejection, sure_scales * scale, cap}));
  }
  return result;
}

}  // namespace eigenpose
