#pragma once

/// How far from its manifold an object may lie and still be itself: learned from the views themselves.
///
/// Two kinds of evidence, both from learned views only. Moved views: every view shifted, scaled and turned a
/// little, as an imperfect cut-out does it, against the full manifold. Left-out views: every second value of
/// one DOF is left out of a manifold fitted to the rest, and found again on it; that also tells whether the
/// DOF can be seen at all.

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/learning/training_views.h"
#include "core/manifold/manifold.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

/// How views are moved, and how the evidence becomes a threshold.
struct RejectionOptions {
  double shift = 0.015;          ///< of the side of the appearance, each way: 2 pixels of 128
  double scale = 0.03;           ///< each way
  double turn_deg = 1.5;         ///< in the picture's plane, each way
  std::size_t moved_views = 4;   ///< of every learned view; fewer where they are thousands
  double accepted_share = 0.99;  ///< of moved views that lie within the threshold
  double slack = 1.15;           ///< the threshold is this times their quantile: n views cannot show the tail
  unsigned threads = 0;
};

/// What the views say of one object.
struct RejectionEvidence {
  double rejection_distance = 0.0;
  double typical_distance = 0.0;  ///< root mean square of the moved views' distances
  std::vector<bool> dof_observable;
  /// For each DOF |error| of left-out views, in its unit; empty where there are too few values to leave any
  /// out.
  std::vector<std::vector<double>> left_out_errors;
};

/// @param points K × M projections of the store's views.
/// @param manifolds one an object of the store, in the same order.
std::vector<RejectionEvidence> measure_rejection(const TrainingViews& views, const Eigenspace& eigenspace,
                                                 const Eigen::MatrixXd& points,
                                                 std::span<const Manifold> manifolds,
                                                 const RejectionOptions& options, const Progress& progress,
                                                 std::stop_token stop);

}  // namespace eigenpose
