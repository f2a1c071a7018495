#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "core/base/clock.h"
#include "core/base/parallel.h"
#include "core/simd/gram_products.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/block_krylov.h"
#include "core/subspace/gram.h"
#include "core/subspace/solvers.h"

namespace eigenpose::detail {
namespace {

constexpr Eigen::Index kKrylovVectors = 400;

/// Q x for a symmetric matrix in memory: every entry is the product of a column with a column.
SymmetricProduct matrix_product(const Eigen::MatrixXd& matrix, unsigned threads) {
  return [&matrix, threads](const Eigen::MatrixXd& x, Eigen::MatrixXd& y) {
    constexpr std::size_t kRows = 48;
    const auto size = static_cast<std::size_t>(matrix.rows());
    const auto columns = static_cast<std::size_t>(x.cols());
    y.setZero();
    parallel_for((size + kRows - 1) / kRows, threads, [&](std::size_t job) {
      const std::size_t first = job * kRows;
      const std::size_t n = std::min(kRows, size - first);
      Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(x.cols(), static_cast<Eigen::Index>(n));
      add_inner_products(Rows<double>{matrix.data() + first * size, size, n},
                         Rows<double>{x.data(), size, columns}, size, Sums<double>{rows.data(), columns});
      y.middleRows(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(n)) = rows.transpose();
    });
  };
}

}  // namespace

EigenPairs leading_gram_pairs(const Eigen::MatrixXd& gram, const SolverTask& task) {
  const Eigen::Index size = gram.rows();
  const auto wanted = static_cast<Eigen::Index>(task.options.components);
  const double noise = rounding_of_scatter(task.source.count());
  if (size > 256 && wanted < size / 6) {
    KrylovOptions krylov;
    krylov.wanted = wanted;
    krylov.noise = noise;
    krylov.max_vectors = kKrylovVectors;
    EigenPairs found =
        leading_eigenpairs(size, matrix_product(gram, task.options.threads), krylov, task.stop);
    if (found.converged) return found;
  }
  return full_eigenpairs(gram, wanted, noise);
}

std::size_t gram_solver_memory(std::size_t count, std::size_t length, std::size_t components) {
  const std::size_t solving = 8 * count * count + 16 * count * std::min<std::size_t>(count, kKrylovVectors);
  const std::size_t projecting = 12 * length * (components + 1) + 16 * count * (components + 1);
  return std::max(solving, projecting);
}

Eigenspace solve_gram(const SolverTask& task, SolverReport& report) {
  const AppearanceSource& source = task.source;
  const SolverOptions& options = task.options;
  const std::size_t fixed = gram_solver_memory(source.count(), source.length(), options.components);
  if (options.memory_limit > 0 && options.memory_limit <= fixed) {
    throw std::invalid_argument("the gram solver needs " + std::to_string(fixed) + " bytes for " +
                                std::to_string(source.count()) + " views beside the tiles, the limit is " +
                                std::to_string(options.memory_limit) + ": raise it or use the krylov solver");
  }
  const std::size_t tiles = options.memory_limit > 0 ? options.memory_limit - fixed : 0;
  const SteadyClock clock;
  const TimePoint start = clock.now();
  const GramOptions gram_options{options.threads, tiles, options.known};
  Eigen::MatrixXd gram = gram_matrix(source, gram_options, task.progress, task.stop);
  if (options.keep_products) options.keep_products(gram);
  const TimePoint solving = clock.now();
  const Eigen::VectorXd norms = view_norms(gram, source.has_bytes());
  const double total = normalize_and_center(gram, norms, options.threads);
  const EigenPairs pairs = leading_gram_pairs(gram, task);
  gram.resize(0, 0);
  check_rank(pairs.values.size());
  const Eigen::Index kept = components_for(pairs.values, total, options);
  judge(pairs, kept, report);
  const TimePoint projecting = clock.now();
  Eigenspace space =
      eigenspace_from_gram(source, norms, {pairs.values.head(kept), pairs.vectors.leftCols(kept), total},
                           {options.threads, tiles}, task.progress, task.stop);
  report.exact_integers = source.has_bytes();
  report.gram_time = solving - start;
  report.solve_time = projecting - solving;
  report.back_projection_time = clock.now() - projecting;
  return space;
}

}  // namespace eigenpose::detail
