#include "core/learning/learning.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/base/utc_text.h"
#include "core/learning/object_eigenspaces.h"
#include "core/learning/training_archive.h"

namespace eigenpose {
namespace {

/// Measures one stage after the other.
class Stopwatch {
 public:
  Duration lap() {
    const auto now = std::chrono::steady_clock::now();
    const Duration since = now - last_;
    last_ = now;
    return since;
  }

 private:
  TimePoint last_ = std::chrono::steady_clock::now();
};

void check_names(std::span<const TrainingSet> sets) {
  std::set<std::string> names;
  for (const TrainingSet& set : sets)
    if (!names.insert(set.object()).second)
      throw Error("two image sets are of the object \"" + set.object() + "\"; learn only one of them");
}

/// An m-DOF manifold needs an eigenspace of more than m dimensions; otherwise it fills the space and every
/// picture lies on it.
void check_dimensions(const ObjectViews& object, Eigen::Index dimensions) {
  const auto dofs = static_cast<Eigen::Index>(object.workspace.size());
  if (dofs < 2 || dimensions > dofs) return;
  throw Error("an eigenspace of " + std::to_string(dimensions) + " dimensions cannot show poses of " +
              std::to_string(dofs) + " degrees of freedom (" + object.object +
              "); learn with more components, or from more views");
}

/// The pictures, object by object, as partial matching learns them. @param views outlives the result.
std::vector<PartsViews> parts_views(const TrainingViews& views) {
  std::vector<PartsViews> result;
  for (const ObjectViews& object : views.objects())
    result.push_back({object.axes, object.count,
                      [&views, first = object.first](std::size_t i) { return views.picture(first + i); },
                      object.poses});
  return result;
}

/// Of the memory that learning may use, pictures take half at most; where they need more, they go to disk.
ViewStoreOptions store_options(const LearningOptions& options) {
  return {options.normalization, options.threads, options.memory_limit / 2, options.scratch_folder,
          options.bad_views};
}

/// The options with what depends on the sets, or on other options, decided.
LearningOptions settled_options(std::span<const TrainingSet> sets, LearningOptions options) {
  options.normalization.cropped =
      !sets.empty() &&
      std::all_of(sets.begin(), sets.end(), [](const TrainingSet& s) { return s.cropped(); });
  options.solver.threads = options.threads;
  options.rejection.threads = options.threads;
  options.calibration.threads = options.threads;
  options.match.threads = options.threads;
  // Windows and alignment look at brightness.
  options.parts = options.parts && !is_range(options.normalization);
  // An alignment eigenspace is an object's own already.
  options.object_spaces = options.object_spaces && !options.parts;
  return options;
}

/// What every stage may use: how to learn, where to report, when to stop.
struct Run {
  const LearningOptions& options;
  LearningReport& report;
  const Progress& progress;
  const std::stop_token& stop;
};

/// The universal eigenspace (eq. 4–7). @param archive gets the inner products, where there is one.
Eigenspace learn_eigenspace(const Run& run, std::span<const TrainingSet> sets, const TrainingViews& views,
                            TrainingArchiveWriter* archive) {
  SolverOptions solver = run.options.solver;
  const KnownProducts known = known_products(sets, views);
  if (!known.rows.empty()) solver.known = &known;
  const std::size_t held =
      views.resident() + sizeof(double) * static_cast<std::size_t>(known.products.size());
  if (run.options.memory_limit > 0)
    solver.memory_limit = run.options.memory_limit > held ? run.options.memory_limit - held : 1;
  if (archive != nullptr)
    solver.keep_products = [archive](const Eigen::MatrixXd& products) { archive->write(products); };
  return solve_eigenspace(views, solver, &run.report.solver, run.progress, run.stop);
}

/// One manifold an object through its points (eq. 8). @param points K × M.
std::vector<Manifold> fit_manifolds(const TrainingViews& views, const Eigen::MatrixXd& points, int degree) {
  std::vector<Manifold> manifolds;
  for (const ObjectViews& object : views.objects()) {
    check_dimensions(object, points.rows());
    manifolds.push_back(Manifold::fit(
        object.axes, object.poses,
        points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count)),
        {.degree = degree}));
  }
  return manifolds;
}

/// @param spaces one an object, or none.
std::vector<ModelObject> model_objects(const TrainingViews& views, std::vector<Manifold> manifolds,
                                       std::span<const RejectionEvidence> evidence,
                                       std::vector<ObjectEigenspace> spaces) {
  std::vector<ModelObject> objects;
  for (std::size_t o = 0; o < manifolds.size(); ++o) {
    const ObjectViews& object = views.objects()[o];
    ModelObject learned{object.object, object.workspace, std::move(manifolds[o])};
    learned.rejection_distance = evidence[o].rejection_distance;
    learned.typical_distance = evidence[o].typical_distance;
    learned.dof_observable = evidence[o].dof_observable;
    learned.pose_observable = evidence[o].dof_observable.front();
    learned.views = object.count;
    if (!spaces.empty()) learned.space = std::move(spaces[o]);
    objects.push_back(std::move(learned));
  }
  return objects;
}

/// Thresholds of the aligned whole region, from the moved views. @param model with `parts`.
void calibrate_match(const Run& run, const Model& model, const TrainingViews& views,
                     const Eigen::MatrixXd& points, PartsModel& parts) {
  run.report.match = measure_match(model, views, points, run.options.match, run.progress, run.stop);
  const MatchThresholds match = match_thresholds(run.report.match, run.options.match);
  parts.sure_ratio = match.sure_ratio;
  parts.smallest_rate = match.smallest_rate;
  for (std::size_t o = 0; o < run.report.match.size(); ++o) {
    parts.calibration[o].rejection_distance = match.rejection_distance[o];
    parts.calibration[o].sure_distance = match.sure_distance[o];
    parts.calibration[o].typical_distance = run.report.match[o].typical_distance;
  }
}

/// Windows and alignment eigenspaces with their thresholds, into model.parts.
void learn_parts_model(const Run& run, const TrainingViews& views, const Eigen::MatrixXd& points,
                       Model& model) {
  const std::vector<PartsViews> pictures = parts_views(views);
  PartsLearningOptions learning;
  learning.threads = run.options.threads;
  const auto parts = std::make_shared<PartsModel>(learn_parts(pictures, learning, run.progress, run.stop));
  for (const ObjectViews& object : views.objects()) parts->extents.push_back(object.extents);
  calibrate_parts(*parts, pictures, run.options.calibration, run.progress, run.stop);
  model.parts = parts;
  calibrate_match(run, model, views, points, *parts);
  OcclusionCalibrationOptions occlusion;
  occlusion.threads = run.options.threads;
  run.report.covered = measure_occlusion(*parts, pictures, occlusion, run.progress, run.stop);
  parts->covered_evidence = occlusion_threshold(run.report.covered, run.options.match.false_acceptance_rate);
}

}  // namespace

std::vector<TrainingSet> all_views(std::span<const ImageSet> sets) {
  std::vector<TrainingSet> result;
  for (const ImageSet& set : sets) result.push_back({&set, {}});
  return result;
}

Eigen::MatrixXd project_all(const AppearanceSource& source, const Eigenspace& eigenspace, unsigned threads) {
  constexpr std::size_t tile_numbers = std::size_t{1} << 20;
  const std::size_t tile_views = std::clamp<std::size_t>(tile_numbers / source.length(), 1, 32);
  const std::size_t count = source.count();
  Eigen::MatrixXd points(eigenspace.components(), static_cast<Eigen::Index>(count));
  const Eigen::VectorXf offset = eigenspace.basis.transpose() * eigenspace.mean;
  parallel_for((count + tile_views - 1) / tile_views, threads, [&](std::size_t t) {
    const std::size_t first = t * tile_views;
    const std::size_t n = std::min(tile_views, count - first);
    Eigen::MatrixXf tile(eigenspace.length(), static_cast<Eigen::Index>(n));
    source.read(first, tile);
    const Eigen::MatrixXf projected = eigenspace.basis.transpose() * tile;
    points.middleCols(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(n)) =
        (projected.colwise() - offset).cast<double>();
  });
  return points;
}

Model learn(std::span<const TrainingSet> sets, LearningOptions options, LearningReport* report,
            const Progress& progress, const std::stop_token& stop) {
  LearningReport unasked;
  LearningReport& result = report != nullptr ? *report : unasked;
  result = {};
  const TimePoint began = std::chrono::steady_clock::now();
  Stopwatch watch;
  check_names(sets);
  options = settled_options(sets, std::move(options));
  const Run run{options, result, progress, stop};
  const std::string created = utc_text(std::chrono::system_clock::now(), UtcDigits::seconds);

  const TrainingViews views(sets, store_options(options), progress, stop);
  result.views = views.count();
  result.left_out.assign(views.left_out().begin(), views.left_out().end());
  std::optional<TrainingArchiveWriter> archive;
  if (!options.kept_views.empty()) archive.emplace(options.kept_views, views, options, created);
  result.normalize_time = watch.lap();

  Model model;
  model.normalization = options.normalization;
  model.eigenspace = learn_eigenspace(run, sets, views, archive ? &*archive : nullptr);
  result.eigenspace_time = watch.lap();

  const Eigen::MatrixXd points = project_all(views, model.eigenspace, options.threads);
  std::vector<Manifold> manifolds = fit_manifolds(views, points, options.spline_degree);
  result.manifold_time = watch.lap();

  result.evidence =
      measure_rejection({views, model.eigenspace, points, manifolds}, options.rejection, progress, stop);
  result.rejection_time = watch.lap();

  std::vector<ObjectEigenspace> spaces;
  if (options.object_spaces)
    spaces = learn_object_eigenspaces(views, result.evidence, options.spline_degree, options.threads,
                                      progress, stop);
  result.object_eigenspace_time = watch.lap();

  model.objects = model_objects(views, std::move(manifolds), result.evidence, std::move(spaces));
  if (options.parts) learn_parts_model(run, views, points, model);
  result.parts_time = watch.lap();

  model.provenance = {options.program_version, created,
                      options.image_sets,      result.solver.solver,
                      result.solver.energy,    result.solver.energy_bound};
  if (archive) {
    result.kept_views = archive->finish();
    if (report == nullptr) result.kept_views->commit();
  }
  result.total_time = std::chrono::steady_clock::now() - began;
  return model;
}

}  // namespace eigenpose
