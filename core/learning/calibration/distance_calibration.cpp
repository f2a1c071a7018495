#include "core/learning/calibration/distance_calibration.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <random>

#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/image/appearance_maker.h"
#include "core/learning/calibration/cross_validation.h"
#include "core/search/search.h"

namespace eigenpose {
namespace {

/// A DOF is seen when left-out views come back this near to their value, as a share of its range. Blind
/// guessing gives a quarter of the range in the median; half a turn wrong every second time gives about as
/// much.
constexpr double observable_error_share = 0.12;
/// Moved views that say enough of all objects together.
constexpr std::size_t most_moved = 3000;

double quantile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double root_mean_square(const std::vector<double>& values) {
  const double squares = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
  return std::sqrt(squares / static_cast<double>(values.size()));
}

/// The view as an imperfect cut-out would show it.
cv::Mat moved(const cv::Mat& view, const RejectionOptions& options, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const double side = view.cols;
  const double turn = options.turn_deg * unit(random);
  const double scale = 1.0 + options.scale * unit(random);
  const auto middle = static_cast<float>(0.5 * (side - 1));
  cv::Mat warp = cv::getRotationMatrix2D({middle, middle}, turn, scale);
  warp.at<double>(0, 2) += options.shift * side * unit(random);
  warp.at<double>(1, 2) += options.shift * side * unit(random);
  cv::Mat result;
  // A mean of distances with "not measured" would be neither.
  const int interpolation = view.depth() == CV_16U ? cv::INTER_NEAREST : cv::INTER_LINEAR;
  cv::warpAffine(view, result, warp, view.size(), interpolation, cv::BORDER_REPLICATE);
  return result;
}

/// Distances of moved views of one object to its manifold.
std::vector<double> moved_distances(const TrainingViews& views, const ObjectViews& object,
                                    const Eigenspace& eigenspace, const ManifoldSearch& search,
                                    const RejectionOptions& options, std::uint32_t seed) {
  const std::size_t copies = std::clamp<std::size_t>(most_moved / views.count(), 1, options.moved_views);
  const std::size_t stride = (views.count() + most_moved - 1) / most_moved;
  std::mt19937 random(seed);
  const Eigen::Index length = eigenspace.length();
  const Eigen::VectorXf offset = eigenspace.basis.transpose() * eigenspace.mean;
  Eigen::MatrixXf tile(length, static_cast<Eigen::Index>(copies));
  std::vector<double> distances;
  AppearanceMaker maker(views.normalization());
  std::vector<float> numbers(picture_length(views.normalization()));
  for (std::size_t i = object.first; i < object.first + object.count; i += stride) {
    const cv::Mat view = views.picture(i);
    for (Eigen::Index c = 0; c < tile.cols(); ++c) {
      picture_numbers(moved(view, options, random), numbers);
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

std::vector<RejectionEvidence> measure_rejection(const TrainingViews& views, const Eigenspace& eigenspace,
                                                 const Eigen::MatrixXd& points,
                                                 std::span<const Manifold> manifolds,
                                                 const RejectionOptions& options, const Progress& progress,
                                                 std::stop_token stop) {
  if (options.moved_views < 1 || !(options.accepted_share > 0.0 && options.accepted_share <= 1.0))
    throw std::invalid_argument("rejection needs at least one moved view and a share of 0 to 1, got " +
                                std::to_string(options.moved_views) + " and " +
                                std::to_string(options.accepted_share));
  std::vector<RejectionEvidence> evidence(manifolds.size());
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(manifolds.size(), options.threads, [&](std::size_t o) {
    if (stop.stop_requested()) throw Interrupted();
    const ObjectViews& object = views.objects()[o];
    RejectionEvidence& found = evidence[o];
    const auto search = make_search("tree", manifolds.subspan(o, 1));
    const auto distances =
        moved_distances(views, object, eigenspace, *search, options, static_cast<std::uint32_t>(o + 1));
    found.typical_distance = root_mean_square(distances);
    found.rejection_distance = options.slack * quantile(distances, options.accepted_share);
    const Eigen::MatrixXd own =
        points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count));
    for (std::size_t d = 0; d < object.axes.size(); ++d) {
      auto errors = left_out_errors(object, d, manifolds[o].degree(), [&](const Fold& fold) {
        return FoldPoints{own(Eigen::all, fold.kept), own(Eigen::all, fold.left_out)};
      });
      found.dof_observable.push_back(
          errors.empty() || quantile(errors, 0.5) <= observable_error_share * object.axes[d].dof.period());
      found.left_out_errors.push_back(std::move(errors));
    }
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"measuring rejection", ++done, manifolds.size()});
  });
  return evidence;
}

}  // namespace eigenpose
