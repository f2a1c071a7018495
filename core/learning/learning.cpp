#include "core/learning/learning.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <optional>
#include <set>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/learning/object_eigenspaces.h"
#include "core/learning/training_archive.h"

namespace eigenpose {
namespace {

std::string utc_now() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

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

/// Poses of several DOFs take more dimensions than these: else their manifold fills the space, and whatever
/// is shown lies on it.
void check_dimensions(const ObjectViews& object, Eigen::Index dimensions) {
  const auto dofs = static_cast<Eigen::Index>(object.workspace.size());
  if (dofs < 2 || dimensions > dofs) return;
  throw Error("an eigenspace of " + std::to_string(dimensions) + " dimensions cannot show poses of " +
              std::to_string(dofs) + " degrees of freedom (" + object.object +
              "); learn with more components, or from more views");
}

/// The pictures of a store, object by object, as partial matching learns them.
std::vector<PartsViews> parts_views(const TrainingViews& views) {
  std::vector<PartsViews> result;
  for (const ObjectViews& object : views.objects())
    result.push_back({object.axes, object.count,
                      [&views, first = object.first](std::size_t i) { return views.picture(first + i); }});
  return result;
}

/// Of the memory that learning may use, pictures take half at most; where they need more, they go to disk.
ViewStoreOptions store_options(const LearningOptions& options) {
  return {options.normalization, options.threads, options.memory_limit / 2, options.scratch_folder};
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
  LearningReport local;
  LearningReport& told = report != nullptr ? *report : local;
  told = {};
  Stopwatch watch;
  const TimePoint began = std::chrono::steady_clock::now();
  check_names(sets);
  options.normalization.cropped =
      !sets.empty() &&
      std::all_of(sets.begin(), sets.end(), [](const TrainingSet& s) { return s.cropped(); });
  options.solver.threads = options.threads;
  options.rejection.threads = options.threads;
  // Windows and alignment look at brightness.
  options.parts = options.parts && !is_range(options.normalization);
  // A pose space is an object's own already, and windows are the second look.
  options.object_spaces = options.object_spaces && !options.parts;

  const TrainingViews views(sets, store_options(options), progress, stop);
  told.views = views.count();
  KnownProducts known = known_products(sets, views);
  if (!known.rows.empty()) options.solver.known = &known;
  const std::size_t held =
      views.resident() + sizeof(double) * static_cast<std::size_t>(known.products.size());
  if (options.memory_limit > 0)
    options.solver.memory_limit = options.memory_limit > held ? options.memory_limit - held : 1;
  const std::string created = utc_now();
  std::optional<TrainingArchiveWriter> kept;
  if (!options.kept_views.empty()) {
    kept.emplace(options.kept_views, views, options, created);
    options.solver.keep_products = [&kept](const Eigen::MatrixXd& products) { kept->write(products); };
  }
  told.normalize_time = watch.lap();

  Model model;
  model.normalization = options.normalization;
  model.eigenspace = solve_eigenspace(views, options.solver, &told.solver, progress, stop);
  known = {};
  told.eigenspace_time = watch.lap();

  for (const ObjectViews& object : views.objects()) check_dimensions(object, model.eigenspace.components());
  const Eigen::MatrixXd points = project_all(views, model.eigenspace, options.threads);
  std::vector<Manifold> manifolds;
  for (const ObjectViews& object : views.objects())
    manifolds.push_back(Manifold::interpolate(
        object.axes,
        points.middleCols(static_cast<Eigen::Index>(object.first), static_cast<Eigen::Index>(object.count)),
        options.spline_degree));
  told.manifold_time = watch.lap();

  told.evidence =
      measure_rejection(views, model.eigenspace, points, manifolds, options.rejection, progress, stop);
  told.rejection_time = watch.lap();

  std::vector<ObjectEigenspace> spaces;
  if (options.object_spaces)
    spaces = learn_object_eigenspaces(views, told.evidence, options.spline_degree, options.threads, progress,
                                      stop);
  told.object_eigenspace_time = watch.lap();
  for (std::size_t o = 0; o < manifolds.size(); ++o) {
    const ObjectViews& object = views.objects()[o];
    const RejectionEvidence& evidence = told.evidence[o];
    ModelObject learned{object.object, object.workspace, std::move(manifolds[o])};
    learned.rejection_distance = evidence.rejection_distance;
    learned.typical_distance = evidence.typical_distance;
    learned.dof_observable = evidence.dof_observable;
    learned.pose_observable = evidence.dof_observable.front();
    learned.views = object.count;
    if (options.object_spaces) learned.space = std::move(spaces[o]);
    model.objects.push_back(std::move(learned));
  }
  if (options.parts) {
    const std::vector<PartsViews> pictures = parts_views(views);
    PartsLearningOptions parts_options;
    parts_options.threads = options.threads;
    options.calibration.threads = options.threads;
    options.match.threads = options.threads;
    const auto parts = std::make_shared<PartsModel>(learn_parts(pictures, parts_options, progress, stop));
    for (const ObjectViews& object : views.objects()) parts->extents.push_back(object.extents);
    calibrate_parts(*parts, pictures, options.calibration, progress, stop);
    model.parts = parts;
    told.match = measure_match(model, views, points, options.match, progress, stop);
    const MatchThresholds match = match_thresholds(told.match, options.match);
    parts->sure_ratio = match.sure_ratio;
    parts->smallest_rate = match.smallest_rate;
    for (std::size_t o = 0; o < told.match.size(); ++o) {
      parts->calibration[o].rejection_distance = match.rejection_distance[o];
      parts->calibration[o].sure_distance = match.sure_distance[o];
      parts->calibration[o].typical_distance = told.match[o].typical_distance;
    }
    OcclusionCalibrationOptions occlusion_options;
    occlusion_options.threads = options.threads;
    told.covered = measure_occlusion(*parts, pictures, occlusion_options, progress, stop);
    parts->covered_evidence = occlusion_threshold(told.covered, options.match.stranger_rate);
    told.parts_time = watch.lap();
  }
  model.provenance = {options.program_version, created,
                      options.image_sets,      told.solver.solver,
                      told.solver.energy,      told.solver.energy_bound};
  if (kept) {
    told.kept_views = kept->finish();
    if (report == nullptr) told.kept_views->commit();
  }
  told.total_time = std::chrono::steady_clock::now() - began;
  return model;
}

}  // namespace eigenpose
