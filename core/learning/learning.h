#pragma once

/// From image sets to a model (sections 3 and 4 of the paper).

#include <filesystem>
#include <span>
#include <stop_token>
#include <string>

#include "core/base/atomic_file.h"
#include "core/base/progress.h"
#include "core/learning/calibration/observability.h"
#include "core/learning/calibration/probes.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"
#include "core/subspace/solver.h"

namespace eigenpose {

struct LearningOptions {
  NormalizationOptions normalization;
  SolverOptions solver;
  int spline_degree = 2;  ///< 1, 2 or 3
  /// What is done about views that cannot be used: `leave_out` names them in the report and learns the rest.
  BadViews bad_views = BadViews::leave_out;
  /// Without parts, learn each object's own eigenspace too: for a second look where two objects are close,
  /// and for pose where it is better.
  bool object_spaces = true;
  /// Learn windows and alignment eigenspaces too: matching that bears occlusion and misalignment. Without,
  /// only the whole region is matched. They use brightness whatever the image type is; of range there are
  /// none.
  bool parts = true;
  DecisionRates rates;   ///< that the thresholds hold
  unsigned threads = 0;  ///< 0: all cores. The model does not depend on it.
  /// Memory for views and solver, bytes; 0 means no limit. Views that do not fit are kept on disk and read in
  /// tiles. Beside it stand the model itself (windows and own spaces grow with the views) and a few pictures
  /// a thread.
  std::size_t memory_limit = 0;
  std::filesystem::path scratch_folder = {};  ///< where that disk is; empty: the folder for temporary files
  /// A file to keep the views and their inner products in, so that objects can join and leave the model later
  /// (training_archive.h); empty: nowhere. See LearningReport::kept_views.
  std::filesystem::path kept_views = {};
  /// Where views are kept ones, the model that was learned with them: alignment eigenspaces, which depend on
  /// an object's own views alone, are taken from it. Null, or another model: they are learned again. Outlives
  /// the call.
  const Model* former = nullptr;
  /// Kept in the model's provenance.
  std::string image_sets;
  std::string program_version;
};

struct LearningReport {
  std::size_t views = 0;
  std::vector<LeftOut> left_out;  ///< views and objects that could not be used, in the order of the sets
  SolverReport solver;
  std::vector<PoseEvidence> evidence;  ///< in the order of the model's objects
  std::vector<Probe> probes;           ///< learned views shown as new and as unknown
  std::size_t kept_probes = 0;         ///< views whose probes a former calibration made
  std::size_t shown_views = 0;         ///< views that were shown now: the others
  Duration normalize_time{};
  Duration eigenspace_time{};
  Duration manifold_time{};
  Duration observability_time{};
  Duration object_eigenspace_time{};
  Duration parts_time{};        ///< windows and alignment eigenspaces
  Duration calibration_time{};  ///< yardsticks, probes and decision
  Duration total_time{};
  /// The kept views, written and verified. `save_with_views` saves them with the model: then neither a full
  /// disk nor a crash leaves a model without its views. Learning without a report commits them itself. Null
  /// where none are kept.
  std::shared_ptr<AtomicFile> kept_views;
};

/// Learns a model of all objects of `sets`. `options.normalization.cropped` is decided here: true when every
/// set is cropped. Views that cannot be used, and objects without enough others, are left out and stand in
/// the report; the other objects are learned without them.
/// @throws FileError, Error (no object left, two sets of one object, too few components for the DOFs; with
/// BadViews::refuse the first view that cannot be used), std::invalid_argument for options out of range,
/// Interrupted.
Model learn(std::span<const TrainingSet> sets, LearningOptions options, LearningReport* report = nullptr,
            const Progress& progress = {}, const std::stop_token& stop = {});

/// All views of every set.
std::vector<TrainingSet> all_views(std::span<const ImageSet> sets);

/// K × M: every appearance of `source` projected. On all cores.
Eigen::MatrixXd project_all(const AppearanceSource& source, const Eigenspace& eigenspace, unsigned threads);

}  // namespace eigenpose
