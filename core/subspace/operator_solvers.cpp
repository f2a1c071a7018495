#include <algorithm>
#include <stdexcept>
#include <string>

#include <Eigen/Core>

#include "core/base/clock.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/block_krylov.h"
#include "core/subspace/conjugate_gradient.h"
#include "core/subspace/scatter_operator.h"
#include "core/subspace/solvers.h"

namespace eigenpose::detail {
namespace {

using Space = ScatterOperator::Space;

struct Plan {
  Space space = Space::views;
  std::size_t block = 0;
  std::size_t vectors = 0;  ///< basis size before a restart
  std::size_t memory = 0;   ///< beside the tiles, bytes
};

Plan plan(const AppearanceSource& source, Space space, std::size_t block, std::size_t vectors,
          std::size_t components) {
  const std::size_t size = space == Space::pixels ? source.length() : source.count();
  Plan result{space, block, std::min(vectors, size), 0};
  const std::size_t images =
      space == Space::pixels ? 6 * size * block : 8 * size * block + source.length() * block;
  const std::size_t solving = 8 * (2 * size * result.vectors + images + source.count() + 3 * source.length());
  const std::size_t projecting =
      12 * source.length() * (components + 1) + 16 * source.count() * (components + 1);
  result.memory = std::max(solving, projecting);
  return result;
}

/// The plan with the fewest passes over the views that fits: wide blocks first; over pixels where that saves
/// reading.
Plan chosen_plan(const AppearanceSource& source, const SolverOptions& options) {
  const bool resident =
      source.has_bytes() ? source.resident_bytes() != nullptr : source.resident_floats() != nullptr;
  const bool pixels_first =
      source.length() <= source.count() || (!resident && source.length() <= 8 * source.count());
  const std::size_t wanted = options.components;
  for (const std::size_t block : {wanted + 4, std::size_t{8}, std::size_t{4}}) {
    for (const std::size_t rounds : {10UL, 5UL, 3UL}) {
      const std::size_t vectors = wanted + 1 + rounds * block;
      for (const Space space :
           {pixels_first ? Space::pixels : Space::views, pixels_first ? Space::views : Space::pixels}) {
        const Plan candidate = plan(source, space, block, vectors, wanted);
        // A third of the limit stays for tiles.
        if (options.memory_limit == 0 ||
            candidate.memory <= options.memory_limit - options.memory_limit / 3) {
          return candidate;
        }
      }
    }
  }
  throw std::invalid_argument("the memory limit of " + std::to_string(options.memory_limit) +
                              " bytes holds no solver for " + std::to_string(source.count()) + " views of " +
                              std::to_string(source.length()) + " numbers and " + std::to_string(wanted) +
                              " components: raise it");
}

/// The eigenspace from eigenvectors in either space.
Eigenspace eigenspace_from_operator(const SolverTask& task, const ScatterOperator& scatter, Space space,
                                    const EigenPairs& pairs, Eigen::Index kept, std::size_t tiles) {
  const Eigen::VectorXd values = pairs.values.head(kept);
  Eigen::MatrixXd vectors = pairs.vectors.leftCols(kept);
  if (space == Space::pixels)
    return finished_eigenspace(scatter.mean(), vectors, values, scatter.total_scatter());
  vectors.rowwise() -= vectors.colwise().mean().eval();
  return eigenspace_from_gram(task.source, scatter.norms(), {values, vectors, scatter.total_scatter()},
                              {task.options.threads, tiles}, task.progress, task.stop);
}

}  // namespace

Eigenspace solve_krylov(const SolverTask& task, SolverReport& report) {
  const AppearanceSource& source = task.source;
  const SolverOptions& options = task.options;
  const Plan chosen = chosen_plan(source, options);
  const std::size_t tiles = options.memory_limit > 0 ? options.memory_limit - chosen.memory : 0;
  const SteadyClock clock;
  const TimePoint start = clock.now();
  ScatterOperator scatter(source, chosen.space, options.threads, tiles, task.progress, task.stop);
  KrylovOptions krylov;
  krylov.wanted = static_cast<Eigen::Index>(options.components);
  krylov.block = static_cast<Eigen::Index>(chosen.block);
  krylov.tolerance = 1e-6;  // far below float rounding of the basis would only cost passes
  krylov.max_vectors = static_cast<Eigen::Index>(chosen.vectors);
  krylov.max_products = 100;
  krylov.noise = rounding_of_scatter(source.count());
  const EigenPairs pairs = leading_eigenpairs(
      scatter.size(), [&](const Eigen::MatrixXd& x, Eigen::MatrixXd& y) { scatter.apply(x, y); }, krylov,
      task.stop);
  check_rank(pairs.values.size());
  const Eigen::Index kept = components_for(pairs.values, scatter.total_scatter(), options);
  judge(pairs, kept, report);
  const TimePoint projecting = clock.now();

  Eigenspace space = eigenspace_from_operator(task, scatter, chosen.space, pairs, kept, tiles);
  report.solve_time = projecting - start;
  report.back_projection_time = clock.now() - projecting;
  return space;
}

Eigenspace solve_conjugate_gradient(const SolverTask& task, SolverReport& report) {
  const AppearanceSource& source = task.source;
  const SolverOptions& options = task.options;
  const Plan chosen = plan(source, source.count() <= source.length() ? Space::views : Space::pixels, 1,
                           options.components + 1, options.components);
  if (options.memory_limit > 0 && chosen.memory >= options.memory_limit) {
    throw std::invalid_argument("the conjugate gradient solver needs " + std::to_string(chosen.memory) +
                                " bytes beside the tiles, the limit is " +
                                std::to_string(options.memory_limit) + ": raise it");
  }
  const std::size_t tiles = options.memory_limit > 0 ? options.memory_limit - chosen.memory : 0;
  const SteadyClock clock;
  const TimePoint start = clock.now();
  ScatterOperator scatter(source, chosen.space, options.threads, tiles, task.progress, task.stop);
  ConjugateGradientOptions gradient;
  gradient.wanted = static_cast<Eigen::Index>(options.components);
  gradient.noise = rounding_of_scatter(source.count());
  const EigenPairs pairs = conjugate_gradient_eigenpairs(
      scatter.size(), [&](const Eigen::MatrixXd& x, Eigen::MatrixXd& y) { scatter.apply(x, y); }, gradient,
      task.stop);
  check_rank(pairs.values.size());
  const Eigen::Index kept = components_for(pairs.values, scatter.total_scatter(), options);
  judge(pairs, kept, report);
  const TimePoint projecting = clock.now();
  Eigenspace space = eigenspace_from_operator(task, scatter, chosen.space, pairs, kept, tiles);
  report.solve_time = projecting - start;
  report.back_projection_time = clock.now() - projecting;
  return space;
}

}  // namespace eigenpose::detail
