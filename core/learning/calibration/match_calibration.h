#pragma once

/// Rejection distances of the aligned whole-region match, from the learned views alone.
///
/// Every learned view is perturbed at random, aligned, and measured against its own manifold: the one through
/// all views, and those through every second, every fourth and every eighth view. Thinning the views by 2, 4
/// and 8 gives two estimates of how the squared interpolation error grows when the step doubles;
/// extrapolated, they give the error at a new view, which is half a step from a learned one. The spread of
/// single views around their expected error is measured at half the views, where both are known. For a small
/// share of the views (surfaces that come into sight within one step) a smaller step promises nothing. An
/// object's threshold is the distance that a share of its new views, the rate, is expected to exceed; n views
/// support no rate below 1/(n + 1).

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/base/progress.h"
#include "core/learning/calibration/perturbation.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"

namespace eigenpose {

struct MatchCalibrationOptions {
  double rate = 0.001;  ///< of false rejections: share of known regions that may be rejected; 0…0.5
  double false_acceptance_rate = 0.005;  ///< share of unknown objects that may get a name; 0…1
  Perturbation perturbation{.shift = 2.0 / 128.0, .scale = 0.03, .turn_deg = 3.0};
  std::size_t copies = 2;  ///< perturbed copies of every learned view; one where views are thousands
  unsigned threads = 0;
};

/// What the perturbed views of one object show.
struct MatchEvidence {
  std::size_t views = 0;          ///< views that were perturbed, each at least once
  double scale = 0.0;             ///< unit of its distances: their mean plus half the largest
  double typical_distance = 0.0;  ///< root mean square expected of new views
  std::vector<double> learned;    ///< squared distance of each view to the manifold through all views
  double missed = 0.0;            ///< mean interpolation error (squared) that twice the step adds
  double growth = 1.0;            ///< ratio of `missed` to the error expected at new views
  std::vector<double> factors;    ///< error of each left-out view over the expected mean
  std::vector<double> others;     ///< distance of each view to the nearest other object
  /// Smallest ratio of squared distances, other over own, among views that another object would win if the
  /// view had not been learned.
  double false_lead = 1.0;
};

/// Thresholds of a model.
struct MatchThresholds {
  std::vector<double> rejection_distance;  ///< one an object; 0 for the one left out
  std::vector<double> sure_distance;       ///< likewise; see PartsCalibration
  double sure_ratio = 0.0;                 ///< see PartsModel
  double smallest_rate = 1.0;              ///< 1/(n + 1)
};

/// Perturbs, aligns and measures all views. @param model with parts and manifolds, its thresholds not yet
/// set.
/// @param points K × M projections of the views. @throws std::invalid_argument for options out of
/// range; Interrupted.
std::vector<MatchEvidence> measure_match(const Model& model, const TrainingViews& views,
                                         const Eigen::MatrixXd& points,
                                         const MatchCalibrationOptions& options, const Progress& progress,
                                         std::stop_token stop);

/// The thresholds that the evidence supports. Unknown objects are assumed to be as far from the learned
/// objects as these are from each other. Where that bound is below the one that known views need, it wins,
/// but never below an object's scale.
/// @param without an object whose views are not used, if any.
MatchThresholds match_thresholds(const std::vector<MatchEvidence>& evidence,
                                 const MatchCalibrationOptions& options,
                                 std::optional<std::size_t> without = std::nullopt);

}  // namespace eigenpose
