#pragma once

/// The solvers behind `solve_eigenspace`, one function each. Internal to the layer.

#include <cstddef>
#include <stop_token>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/eigen_pairs.h"
#include "core/subspace/eigenspace.h"
#include "core/subspace/solver.h"

namespace eigenpose::detail {

/// What a solver works on. `options.components` is at most M − 1 already.
struct SolverTask {
  const AppearanceSource& source;
  const SolverOptions& options;
  const Progress& progress;
  std::stop_token stop;
};

/// The options with K at most what M views of N numbers span. @throws std::invalid_argument for fewer than
/// two views, no components, or an energy outside (0, 1].
SolverOptions checked_options(const AppearanceSource& source, const SolverOptions& options);
/// Fills components and energy, and notes where they are fewer than asked for.
void complete_report(const Eigenspace& space, const SolverOptions& asked, SolverReport& report);

Eigenspace solve_gram(const SolverTask& task, SolverReport& report);
Eigenspace solve_krylov(const SolverTask& task, SolverReport& report);
Eigenspace solve_conjugate_gradient(const SolverTask& task, SolverReport& report);
Eigenspace solve_sta(const SolverTask& task, SolverReport& report);
Eigenspace solve_joined(const SolverTask& task, SolverReport& report);

/// The unit-energy appearances of views [first, first + n) in double, less their mean: N × n.
/// @throws std::invalid_argument for a black view.
Eigen::MatrixXd centred_appearances(const AppearanceSource& source, std::size_t first, std::size_t n,
                                    Eigen::VectorXd& mean);

/// The K leading eigenpairs of a centred Gram matrix, or of another with the same scatter: block Krylov, or
/// the full eigen-solve of small ones.
EigenPairs leading_gram_pairs(const Eigen::MatrixXd& gram, const SolverTask& task);

/// Memory that the Gram solver needs beside the tiles, bytes.
std::size_t gram_solver_memory(std::size_t count, std::size_t length, std::size_t components);

/// Eigenvalues at most this are rounding of the M × M products of unit-energy views.
double rounding_of_scatter(std::size_t count);

/// How many of the descending `values` to keep: all, or the fewest that keep `energy` of the scatter.
Eigen::Index components_for(const Eigen::VectorXd& values, double total_scatter,
                            const SolverOptions& options);

/// By a full eigen-solve of a symmetric matrix in double: the leading `wanted`, those above `noise`.
EigenPairs full_eigenpairs(const Eigen::MatrixXd& matrix, Eigen::Index wanted, double noise);

/// Fills the report's residual over gap for the first `kept` pairs, notes a tie at the cut, and refuses an
/// inaccurate answer. @throws Error.
void judge(const EigenPairs& pairs, Eigen::Index kept, SolverReport& report);

/// @throws Error when there is nothing to span: all views are equal.
void check_rank(Eigen::Index rank);

}  // namespace eigenpose::detail
