#pragma once

/// Rejection distances of the aligned whole-region match, from the learned views alone.
///
/// Every learned view is moved at random, as an imperfect cut-out does it, aligned, and measured against its
/// own manifold: as learned, and without every second view, with every fourth and every eighth only. By how
/// much the spline misses more when the step doubles is seen twice so; from both, what it misses at a new
/// view, half a step from a learned one. How far single views are off such an expectation is seen at half the
/// views, of which it is known what they miss, and what was to be expected from a fourth. A few views show
/// what comes into sight at once: of these, smaller steps promise nothing. An object's threshold is the
/// distance that a share of its new views, the rate, is expected to exceed; n views support no rate below
/// 1/(n + 1).

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/base/progress.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"

namespace eigenpose {

struct MatchCalibrationOptions {
  double rate = 0.001;           ///< share of known regions that may be rejected; 0…0.5
  double stranger_rate = 0.005;  ///< share of strangers that may be accepted; 0…1
  double shift = 2.0 / 128.0;    ///< of the side of the appearance, each way
  double scale = 0.03;           ///< each way
  double turn_deg = 3.0;         ///< in the picture's plane, each way
  std::size_t moved_views = 2;   ///< of every learned view; fewer, but one, where they are thousands
  unsigned threads = 0;
};

/// What the moved views of one object show.
struct MatchEvidence {
  std::size_t views = 0;          ///< of which each was moved once or more
  double scale = 0.0;             ///< in which its distances are measured
  double typical_distance = 0.0;  ///< root mean square expected of new views
  std::vector<double> learned;    ///< squared distance of each view to the manifold that knows it
  double missed = 0.0;            ///< what the spline adds to it where the step is twice as large, on average
  double growth = 1.0;            ///< `missed` over what it is expected to be at new views
  std::vector<double> factors;    ///< what it added at views left out, over what was expected on average
  std::vector<double> others;     ///< distance of each view to the nearest other object
  double false_lead = 1.0;  ///< squared distances, other over own, of the worst view that another object wins
};

/// Thresholds of a model.
struct MatchThresholds {
  std::vector<double> rejection_distance;  ///< one an object; 0 for the one left out
  std::vector<double> sure_distance;       ///< likewise; see PartsCalibration
  double sure_ratio = 0.0;                 ///< see PartsModel
  double smallest_rate = 1.0;              ///< 1/(n + 1)
};

/// Moves, aligns and measures all views. @param model with parts and manifolds, its thresholds not yet set.
/// @param points K × M projections of the store's views. @throws std::invalid_argument for options out of
/// range; Interrupted.
std::vector<MatchEvidence> measure_match(const Model& model, const TrainingViews& views,
                                         const Eigen::MatrixXd& points,
                                         const MatchCalibrationOptions& options, const Progress& progress,
                                         std::stop_token stop);

/// What the evidence supports. Strangers are taken to be as unlike the learned objects as these are unlike
/// each other: where that leaves less room than known views ask for, it wins, but never below an object's
/// scale.
/// @param without an object whose views are not used, if any.
MatchThresholds match_thresholds(const std::vector<MatchEvidence>& evidence,
                                 const MatchCalibrationOptions& options,
                                 std::optional<std::size_t> without = std::nullopt);

}  // namespace eigenpose
