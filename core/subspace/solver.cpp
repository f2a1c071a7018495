#include "core/subspace/solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/subspace/block_krylov.h"
#include "core/subspace/solvers.h"

namespace eigenpose {
namespace {

using Solve = Eigenspace (*)(const detail::SolverTask&, SolverReport&);
struct NamedSolver {
  std::string_view name;
  Solve solve;
};
constexpr std::array kSolvers{NamedSolver{"gram", detail::solve_gram},
                              NamedSolver{"dense", detail::solve_dense}};

/// An answer that may be farther from the true subspace is refused: the sine of 0.06°.
constexpr double kLargestSine = 1e-3;

std::string chosen_solver(const AppearanceSource&, const SolverOptions& options) {
  return options.solver == "auto" ? "gram" : options.solver;
}

void check_options(const AppearanceSource& source, const SolverOptions& options) {
  if (source.count() < 2) {
    throw std::invalid_argument("an eigenspace needs at least two views, there are " +
                                std::to_string(source.count()));
  }
  if (source.length() == 0) throw std::invalid_argument("the appearances have no numbers");
  if (options.components == 0) throw std::invalid_argument("components = 0: ask for at least one");
  if (options.energy && !(*options.energy > 0.0 && *options.energy <= 1.0)) {
    throw std::invalid_argument("energy = " + std::to_string(*options.energy) + ": it is a share in (0, 1]");
  }
}

}  // namespace

Eigenspace solve_eigenspace(const AppearanceSource& source, const SolverOptions& options,
                            SolverReport* report, const Progress& progress, std::stop_token stop) {
  check_options(source, options);
  const std::string name = chosen_solver(source, options);
  const auto* solver =
      std::find_if(kSolvers.begin(), kSolvers.end(), [&](const auto& s) { return s.name == name; });
  if (solver == kSolvers.end()) {
    std::string known = "auto";
    for (const auto& s : kSolvers) known += ", " + std::string(s.name);
    throw std::invalid_argument("unknown solver '" + options.solver + "'; known are " + known);
  }
  SolverOptions bounded = options;
  bounded.components = std::min(options.components, std::min(source.count() - 1, source.length()));
  SolverReport result;
  result.solver = name;
  Eigenspace space = solver->solve({source, bounded, progress, std::move(stop)}, result);
  result.components = static_cast<std::size_t>(space.components());
  result.energy =
      space.total_scatter > 0.0 ? std::min(1.0, space.eigenvalues.sum() / space.total_scatter) : 0.0;
  if (result.components < options.components && !options.energy) {
    if (!result.note.empty()) result.note += "; ";
    result.note += "the views span " + std::to_string(result.components) + " dimensions, " +
                   std::to_string(options.components) + " were asked for";
  }
  if (report != nullptr) *report = std::move(result);
  return space;
}

namespace detail {

double rounding_of_scatter(std::size_t count) {
  return 64.0 * static_cast<double>(count) * std::numeric_limits<double>::epsilon();
}

Eigen::Index components_for(const Eigen::VectorXd& values, double total_scatter,
                            const SolverOptions& options) {
  if (!options.energy) return values.size();
  // Rounding in the sums must not ask for one more at energy = 1.
  const double enough = *options.energy * total_scatter * (1.0 - 1e-12);
  double sum = 0.0;
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    sum += values[k];
    if (sum >= enough) return k + 1;
  }
  return values.size();
}

void judge(const EigenPairs& pairs, Eigen::Index kept, SolverReport& report) {
  const double last = pairs.values[kept - 1];
  const double next = kept < pairs.values.size() ? pairs.values[kept] : pairs.next_value;
  const bool tied = last - next <= kEqualEigenvalues * pairs.values[0];
  report.residual_over_gap = pairs.residuals.head(kept).norm() / (tied ? last : last - next);
  if (!(report.residual_over_gap <= kLargestSine)) {
    throw Error("the " + report.solver +
                " solver did not reach an accurate eigenspace: residual over eigenvalue gap is " +
                std::to_string(report.residual_over_gap) + ", at most " + std::to_string(kLargestSine) +
                " is accepted; use another number of components or the gram solver");
  }
  if (tied)
    report.note =
        "the last eigenvalue kept and the first left out are equal: the cut between them is one of many";
}

void check_rank(Eigen::Index rank) {
  if (rank == 0)
    throw Error("all views are the same image up to brightness: there is nothing to span; add other views");
}

}  // namespace detail
}  // namespace eigenpose
