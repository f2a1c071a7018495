#include "core/learning/learning.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/base/utc_text.h"
#include "core/learning/calibration/decision_calibration.h"
#include "core/learning/calibration/yardsticks.h"
#include "core/learning/object_eigenspaces.h"
#include "core/learning/parts_learning.h"
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

/// The pictures, object by object, as partial matching learns them. @param views outlives the result, and so
/// does the former model, where there is one.
std::vector<PartsViews> parts_views(std::span<const TrainingSet> sets, const TrainingViews& views,
                                    const Model* former) {
  std::vector<PartsViews> result;
  for (std::size_t o = 0; o < views.objects().size(); ++o) {
    const ObjectViews& object = views.objects()[o];
    result.push_back({object.axes, object.count,
                      [&views, first = object.first](std::size_t i) { return views.picture(first + i); },
                      object.poses});
    const TrainingSet& set = sets[views.sets()[o]];
    if (former == nullptr || !former->parts || set.kept == nullptr || !set.kept->belong_to(*former)) continue;
    result.back().alignment = &former->parts->poses[set.kept_object];
    result.back().left_out_errors = set.kept->left_out_errors(set.kept_object);
  }
  return result;
}

/// Of the memory that learning may use, pictures take half at most; where they need more, they go to disk.
ViewStoreOptions store_options(const LearningOptions& options) {
  return {options.normalization, options.threads, options.memory_limit / 2, options.scratch_folder,
          options.bad_views};
}

/// The options with what depends on the sets, or on other options, decided.
LearningOptions settled_options(std::span<const TrainingSet> sets, LearningOptions options) {
  check_rates(options.rates);
  options.normalization.cropped =
      !sets.empty() &&
      std::all_of(sets.begin(), sets.end(), [](const TrainingSet& s) { return s.cropped(); });
  options.solver.threads = options.threads;
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
    solver.keep_products = [archive](const Eigen::MatrixXd& products) { archive->keep(products); };
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
                                       std::span<const PoseEvidence> evidence,
                                       std::vector<ObjectEigenspace> spaces) {
  std::vector<ModelObject> objects;
  for (std::size_t o = 0; o < manifolds.size(); ++o) {
    const ObjectViews& object = views.objects()[o];
    ModelObject learned{object.object, object.workspace, std::move(manifolds[o])};
    learned.dof_observable = evidence[o].dof_observable;
    learned.pose_observable = evidence[o].dof_observable.front();
    learned.views = object.count;
    if (!spaces.empty()) learned.space = std::move(spaces[o]);
    objects.push_back(std::move(learned));
  }
  return objects;
}

/// Windows and alignment eigenspaces.
std::shared_ptr<PartsModel> learn_parts_model(const Run& run, std::span<const TrainingSet> sets,
                                              const TrainingViews& views) {
  PartsLearningOptions learning;
  learning.threads = run.options.threads;
  auto parts = std::make_shared<PartsModel>(
      learn_parts(parts_views(sets, views, run.options.former), learning, run.progress, run.stop));
  for (const ObjectViews& object : views.objects()) parts->extents.push_back(object.extents);
  return parts;
}

/// The views, and their projections, K × M.
struct Learned {
  const TrainingViews& views;
  const Eigen::MatrixXd& points;
};

/// The yardsticks of the objects, and the decision, from the learned views shown as new and as unknown.
/// @param parts those of the model, where it has any. @param kept what is known of it already.
/// @return what is known of it now, for an update; only with parts: without, measuring costs little.
CalibrationRecord calibrate(const Run& run, const Learned& learned, CalibrationRecord kept,
                            const std::shared_ptr<PartsModel>& parts, Model& model) {
  const auto& [views, points] = learned;
  YardstickOptions yardstick;
  ProbeOptions probe;
  yardstick.threads = probe.threads = run.options.threads;
  // Without alignment, misalignment adds to every distance: what segmentation causes on average.
  if (!parts) yardstick.perturbation = {.shift = 0.015, .scale = 0.03, .turn_deg = 1.5, .tint = usual_tint};
  yardstick.kept = kept.objects;
  Yardsticks yardsticks = measure_yardsticks(model, views, points, yardstick, run.progress, run.stop);
  for (std::size_t o = 0; o < model.objects.size(); ++o)
    model.objects[o].typical_distance = yardsticks.typical_distance[o];
  if (parts) parts->calibration = yardsticks.windows;
  model.decision.weights =
      prior_weights(parts && !parts->colors.empty() ? ViewColors::some : ViewColors::none);
  if (!kept.objects.empty()) {
    drop_within_reach(kept, model, views, points);
    probe.kept = &kept;
  }
  CalibrationRecord record;
  record.shown = show_views(model, views, yardsticks, probe, run.progress, run.stop);
  run.report.probes = probes_of(record.shown);
  run.report.kept_probes = static_cast<std::size_t>(
      std::ranges::count_if(kept.shown, [](const ShownProbes& shown) { return !shown.probes.empty(); }));
  run.report.shown_views = record.shown.size() - run.report.kept_probes;
  model.decision = calibrate_decision(run.report.probes, run.options.rates);
  if (!parts) return {};
  record.objects = std::move(yardsticks.records);
  record.measured_among = kept.objects.empty() ? model.objects.size() : kept.measured_among;
  record.changes = kept.changes;
  return record;
}

/// Whether the left-out views of each object show their poses.
std::vector<PoseEvidence> measure_poses(const Run& run, const TrainingViews& views,
                                        const Eigen::MatrixXd& points, std::span<const Manifold> manifolds) {
  std::vector<PoseEvidence> evidence(manifolds.size());
  parallel_for(manifolds.size(), run.options.threads, [&](std::size_t o) {
    if (run.stop.stop_requested()) throw Interrupted();
    const ObjectViews& object = views.objects()[o];
    evidence[o] = measure_observability(
        object,
        points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count)),
        manifolds[o].degree());
  });
  return evidence;
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

  result.evidence = measure_poses(run, views, points, manifolds);
  result.observability_time = watch.lap();

  std::vector<ObjectEigenspace> spaces;
  if (options.object_spaces)
    spaces = learn_object_eigenspaces(views, result.evidence, options.spline_degree, options.threads,
                                      progress, stop);
  result.object_eigenspace_time = watch.lap();

  model.objects = model_objects(views, std::move(manifolds), result.evidence, std::move(spaces));
  std::shared_ptr<PartsModel> parts;
  if (options.parts) parts = learn_parts_model(run, sets, views);
  model.parts = parts;
  result.parts_time = watch.lap();

  const CalibrationRecord calibration = calibrate(
      run, {views, points}, parts ? known_calibration(sets, views) : CalibrationRecord{}, parts, model);
  result.calibration_time = watch.lap();

  model.provenance = {options.program_version, created,
                      options.image_sets,      result.solver.solver,
                      result.solver.energy,    result.solver.energy_bound};
  if (archive) {
    result.kept_views = archive->finish(calibration, parts.get());
    if (report == nullptr) result.kept_views->commit();
  }
  result.total_time = std::chrono::steady_clock::now() - began;
  return model;
}

}  // namespace eigenpose
