#pragma once

/// Whether the pose can be seen: views left out of a manifold are found again on it, or not.

#include <cstddef>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/learning/training_views.h"
#include "core/manifold/manifold.h"

namespace eigenpose {

/// What the left-out views of one object show.
struct PoseEvidence {
  std::vector<bool> dof_observable;
  /// For each DOF |error| of left-out views, in its unit; empty where the DOF has too few values to leave any
  /// out.
  std::vector<std::vector<double>> left_out_errors;
};

/// The evidence of one object. @param points K × n projections of its views.
PoseEvidence measure_observability(const ObjectViews& object, const Eigen::MatrixXd& points, int degree);

}  // namespace eigenpose
