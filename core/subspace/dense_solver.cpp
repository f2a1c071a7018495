#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/base/clock.h"
#include "core/base/linear_algebra.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solvers.h"
#include "core/subspace/view_reader.h"

namespace eigenpose::detail {

Eigen::MatrixXd centred_appearances(const AppearanceSource& source, std::size_t first, std::size_t n,
                                    Eigen::VectorXd& mean) {
  Eigen::MatrixXd views(static_cast<Eigen::Index>(source.length()), static_cast<Eigen::Index>(n));
  ViewReader reader(source);
  for (Eigen::Index j = 0; j < views.cols(); ++j) {
    const std::size_t number = first + static_cast<std::size_t>(j);
    reader.read(number, 1).widen(0, 0, source.length(), views.col(j).data());
    if (!source.has_bytes()) continue;
    const double norm = views.col(j).norm();
    if (norm == 0.0) {
      throw std::invalid_argument("view " + std::to_string(number) +
                                  " is black: it has no energy to scale; leave it out");
    }
    views.col(j) /= norm;
  }
  mean = views.rowwise().mean();
  views.colwise() -= mean;
  return views;
}

EigenPairs full_eigenpairs(const Eigen::MatrixXd& matrix, Eigen::Index wanted, double noise) {
  const auto [values, vectors] = symmetric_eigen(matrix);
  Eigen::Index rank = 0;
  while (rank < std::min(wanted, values.size()) && values[rank] > noise) ++rank;
  EigenPairs pairs;
  pairs.values = values.head(rank);
  pairs.vectors = vectors.leftCols(rank);
  pairs.residuals = (matrix * pairs.vectors - pairs.vectors * pairs.values.asDiagonal()).colwise().norm();
  pairs.next_value = rank < values.size() ? std::max(values[rank], 0.0) : 0.0;
  return pairs;
}

Eigenspace solve_dense(const SolverTask& task, SolverReport& report) {
  const AppearanceSource& source = task.source;
  const std::size_t smaller = std::min(source.count(), source.length());
  const std::size_t needed = 16 * source.count() * source.length() + 24 * smaller * smaller;
  if (task.options.memory_limit > 0 && needed > task.options.memory_limit) {
    throw std::invalid_argument("the dense solver needs " + std::to_string(needed) + " bytes, the limit is " +
                                std::to_string(task.options.memory_limit) +
                                ": raise it or use another solver");
  }
  const SteadyClock clock;
  const TimePoint start = clock.now();
  Eigen::VectorXd mean;
  const Eigen::MatrixXd views = centred_appearances(source, 0, source.count(), mean);
  const bool over_views = views.cols() <= views.rows();
  const Eigen::MatrixXd scatter =
      over_views ? Eigen::MatrixXd(views.transpose() * views) : Eigen::MatrixXd(views * views.transpose());
  const TimePoint solving = clock.now();
  const double noise = rounding_of_scatter(source.count());
  const EigenPairs pairs =
      full_eigenpairs(scatter, static_cast<Eigen::Index>(task.options.components), noise);
  check_rank(pairs.values.size());
  const double total = scatter.trace();
  const Eigen::Index kept = components_for(pairs.values, total, task.options);
  judge(pairs, kept, report);
  const TimePoint projecting = clock.now();
  Eigen::MatrixXd basis = pairs.vectors.leftCols(kept);
  if (over_views)
    basis = (views * basis).eval() * pairs.values.head(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  Eigenspace space = finished_eigenspace(mean, basis, pairs.values.head(kept), total);
  report.gram_time = solving - start;
  report.solve_time = projecting - solving;
  report.back_projection_time = clock.now() - projecting;
  return space;
}

}  // namespace eigenpose::detail
