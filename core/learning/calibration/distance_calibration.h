#pragma once

/// How far from its manifold an object may lie and still be itself: learned from the views themselves.
///
/// Two kinds of evidence, both from learned views only. Perturbed views: every view is shifted, scaled and
/// turned at random, as imperfect segmentation does it, and its distance to the full manifold is measured.
/// Left-out views: every second value of one DOF is left out of a manifold fitted to the rest, and found
/// again on it; this also shows whether the DOF is observable.

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/learning/calibration/perturbation.h"
#include "core/learning/training_views.h"
#include "core/manifold/manifold.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

/// How views are perturbed, and how the evidence becomes a threshold.
struct RejectionOptions {
  Perturbation perturbation{.shift = 0.015, .scale = 0.03, .turn_deg = 1.5};  ///< 2 pixels of 128
  std::size_t copies = 4;        ///< perturbed copies of every learned view; fewer where views are thousands
  double accepted_share = 0.99;  ///< of perturbed views that lie within the threshold; in (0, 1]
  double slack = 1.15;           ///< the threshold is this times their quantile: n views cannot show the tail
  unsigned threads = 0;
};

/// What the views say of one object.
struct RejectionEvidence {
  double rejection_distance = 0.0;
  double typical_distance = 0.0;  ///< root mean square of the perturbed views' distances
  std::vector<bool> dof_observable;
  /// For each DOF |error| of left-out views, in its unit; empty where the DOF has too few values to leave any
  /// out.
  std::vector<std::vector<double>> left_out_errors;
};

/// Views and what was learned of them so far. All are kept by reference.
struct LearnedManifolds {
  const TrainingViews& views;
  const Eigenspace& eigenspace;
  const Eigen::MatrixXd& points;        ///< K × M projections of the views
  std::span<const Manifold> manifolds;  ///< one an object of `views`, in the same order
};

/// The evidence for each object. @throws std::invalid_argument for options out of range; Interrupted.
std::vector<RejectionEvidence> measure_rejection(const LearnedManifolds& learned,
                                                 const RejectionOptions& options, const Progress& progress,
                                                 std::stop_token stop);

}  // namespace eigenpose
