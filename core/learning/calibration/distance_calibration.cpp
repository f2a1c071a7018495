#include "core/learning/calibration/distance_calibration.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"
#include "core/image/appearance_maker.h"
#include "core/learning/calibration/cross_validation.h"
#include "core/search/search.h"

namespace eigenpose {
namespace {

/// A DOF is observable when the median error of left-out views is at most this share of its range. Blind
/// guessing gives a quarter of the range; half a turn wrong every second time gives about as much.
constexpr double observable_error_share = 0.12;
/// Perturbed views that are enough for all objects together.
constexpr std::size_t most_for_rejection = 3000;

/// Distances of perturbed views of one object to its manifold.
std::vector<double> perturbed_distances(const TrainingViews& views, const ObjectViews& object,
                                        const Eigenspace& eigenspace, const ManifoldSearch& search,
                                        const RejectionOptions& options, std::uint32_t seed) {
  const std::size_t copies = std::clamp<std::size_t>(most_for_rejection / views.count(), 1, options.copies);
  const std::size_t stride = (views.count() + most_for_rejection - 1) / most_for_rejection;
  SeededRandom random(seed);
  const Eigen::Index length = eigenspace.length();
  const Eigen::VectorXf offset = eigenspace.basis.transpose() * eigenspace.mean;
  Eigen::MatrixXf tile(length, static_cast<Eigen::Index>(copies));
  std::vector<double> distances;
  AppearanceMaker maker(views.normalization());
  std::vector<float> numbers(picture_length(views.normalization()));
  for (std::size_t i = object.first; i < object.first + object.count; i += stride) {
    const cv::Mat view = views.picture(i);
    for (Eigen::Index c = 0; c < tile.cols(); ++c) {
      picture_numbers(displaced(view, options.perturbation.draw(random)), numbers);
      maker.make(numbers, {tile.col(c).data(), static_cast<std::size_t>(length)});
      tile.col(c).normalize();
    }
    const Eigen::MatrixXf projected = (eigenspace.basis.transpose() * tile).colwise() - offset;
    for (Eigen::Index c = 0; c < projected.cols(); ++c)
      distances.push_back(search.nearest(projected.col(c), 1).front().distance);
  }
  return distances;
}

}  // namespace

std::vector<RejectionEvidence> measure_rejection(const LearnedManifolds& learned,
                                                 const RejectionOptions& options, const Progress& progress,
                                                 std::stop_token stop) {
  const TrainingViews& views = learned.views;
  const std::span<const Manifold> manifolds = learned.manifolds;
  if (options.copies < 1 || !(options.accepted_share > 0.0 && options.accepted_share <= 1.0))
    throw std::invalid_argument(
        "rejection needs at least one perturbed copy and an accepted share in (0, 1], got " +
        std::to_string(options.copies) + " and " + std::to_string(options.accepted_share));
  std::vector<RejectionEvidence> evidence(manifolds.size());
  WorkMeter meter(progress, std::move(stop), "measuring rejection", manifolds.size());
  parallel_for(manifolds.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    const ObjectViews& object = views.objects()[o];
    RejectionEvidence& found = evidence[o];
    const auto search = make_search("tree", manifolds.subspan(o, 1));
    auto distances = perturbed_distances(views, object, learned.eigenspace, *search, options,
                                         static_cast<std::uint32_t>(o + 1));
    found.typical_distance = root_mean_square(distances);
    found.rejection_distance = options.slack * quantile(distances, options.accepted_share);
    const Eigen::MatrixXd own = learned.points.middleCols(static_cast<Eigen::Index>(object.first),
                                                          static_cast<Eigen::Index>(object.count));
    for (std::size_t d = 0; d < object.axes.size(); ++d) {
      auto errors = left_out_errors(object, d, manifolds[o].degree(), [&](const Fold& fold) {
        return FoldPoints{own(Eigen::all, fold.kept), own(Eigen::all, fold.left_out)};
      });
      found.dof_observable.push_back(errors.empty() ||
                                     quantile(std::vector<double>(errors), 0.5) <=
                                         observable_error_share * object.axes[d].dof.period());
      found.left_out_errors.push_back(std::move(errors));
    }
    meter.finished(1);
  });
  return evidence;
}

}  // namespace eigenpose
