#include "core/learning/object_eigenspaces.h"

#include <algorithm>
#include <mutex>
#include <numeric>
#include <optional>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/learning/calibration/cross_validation.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"

namespace eigenpose {
namespace {

/// At most one component per view of a turn is useful; larger grids are cut off here.
constexpr std::size_t most_components = 80;

/// Mean of the errors, none counted as more than `most`.
double bounded_mean(const std::vector<double>& errors, double most) {
  const double sum = std::accumulate(errors.begin(), errors.end(), 0.0, [&](double so_far, double error) {
    return so_far + std::min(error, most);
  });
  return sum / static_cast<double>(errors.size());
}

/// The object's views reduced and of unit energy, one column each.
Eigen::MatrixXf reduced_views(const TrainingViews& views, const ObjectViews& object) {
  const NormalizationOptions& options = views.normalization();
  const int side = reduced_side(options);
  const int bands = appearance_bands(options);
  Eigen::MatrixXf reduced(Eigen::Index{side} * side * bands, static_cast<Eigen::Index>(object.count));
  Eigen::MatrixXf appearance(static_cast<Eigen::Index>(views.length()), 1);
  for (std::size_t i = 0; i < object.count; ++i) {
    views.read(object.first + i, appearance);
    auto column = reduced.col(static_cast<Eigen::Index>(i));
    shrink_appearance({appearance.data(), views.length()}, options.size, bands, side,
                      {column.data(), static_cast<std::size_t>(column.size())});
    column.normalize();
  }
  return reduced;
}

Eigenspace span_of(const Eigen::MatrixXf& columns) {
  SolverOptions options;
  options.solver = "gram";
  options.threads = 1;
  options.components = std::min<std::size_t>(most_components, static_cast<std::size_t>(columns.cols()) - 1);
  return solve_eigenspace(FloatSource(columns), options);
}

Eigen::MatrixXd project(const Eigenspace& space, const Eigen::MatrixXf& columns) {
  return (space.basis.transpose() * (columns.colwise() - space.mean)).cast<double>();
}

}  // namespace

std::vector<ObjectEigenspace> learn_object_eigenspaces(const TrainingViews& views,
                                                       std::span<const PoseEvidence> evidence, int degree,
                                                       unsigned threads, const Progress& progress,
                                                       std::stop_token stop) {
  const auto objects = views.objects();
  std::vector<std::optional<ObjectEigenspace>> spaces(objects.size());
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(objects.size(), threads, [&](std::size_t o) {
    if (stop.stop_requested()) throw Interrupted();
    const ObjectViews& object = objects[o];
    const Eigen::MatrixXf columns = reduced_views(views, object);
    Eigenspace space = span_of(columns);
    Manifold manifold = Manifold::fit(object.axes, object.poses, project(space, columns), {.degree = degree});
    const auto errors = left_out_errors(object, 0, degree, [&](const Fold& fold) {
      const Eigen::MatrixXf kept = columns(Eigen::all, fold.kept);
      const Eigenspace without = span_of(kept);
      return FoldPoints{project(without, kept), project(without, columns(Eigen::all, fold.left_out))};
    });
    const auto& universal = evidence[o].left_out_errors.front();
    // The object's own eigenspace refines a pose within a step of the universal one: larger errors do not
    // count.
    const SampleAxis& axis = object.axes.front();
    const double step = axis.dof.period() / static_cast<double>(axis.samples.size());
    const bool better = !errors.empty() && bounded_mean(errors, step) < bounded_mean(universal, step);
    spaces[o] = ObjectEigenspace{std::move(space), std::move(manifold), better};
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"learning each object's own space", ++done, objects.size()});
  });
  std::vector<ObjectEigenspace> result;
  for (auto& space : spaces) result.push_back(std::move(*space));
  return result;
}

}  // namespace eigenpose
