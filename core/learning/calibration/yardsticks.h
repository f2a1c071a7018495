#pragma once

/// How well new views of each object will match it, as measured on the learned ones: see probes.h.

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/learning/calibration/calibration_record.h"
#include "core/learning/calibration/perturbation.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"

namespace eigenpose {

struct YardstickOptions {
  Perturbation perturbation{.shift = 2.0 / 128.0, .scale = 0.03, .turn_deg = 3.0, .tint = usual_tint};
  /// The misalignment that alignment leaves, for windows.
  Perturbation residual{.shift = 0.5 / 64.0, .scale = 0.01, .turn_deg = 1.0, .tint = usual_tint};
  unsigned threads = 0;
  /// What a former calibration measured of each object alone: empty records are measured, the others are
  /// used.
  std::span<const ObjectRecord> kept = {};
};

/// What the views of all objects say.
struct Yardsticks {
  Perturbation perturbation;  ///< that the views were shown with
  /// For each object and view the squared distance that a new view there is expected to have.
  std::vector<std::vector<double>> squared;
  std::vector<double> typical_distance;   ///< one an object: root mean square of new views
  std::vector<PartsCalibration> windows;  ///< one an object; empty without parts
  double half_step = 0.5;             ///< of a whole step's change of votes, the share that half a step makes
  std::vector<ObjectRecord> records;  ///< one an object: what another calibration may use
};

/// Measures distances of all views. @param model with manifolds, and parts where it has any.
/// @param points K × M projections of the views. @throws Interrupted.
Yardsticks measure_yardsticks(const Model& model, const TrainingViews& views, const Eigen::MatrixXd& points,
                              const YardstickOptions& options, const Progress& progress,
                              const std::stop_token& stop);

}  // namespace eigenpose
