#include "core/subspace/solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/subspace/solvers.h"

namespace eigenpose {
namespace {

using Solve = Eigenspace (*)(const detail::SolverTask&, SolverReport&);
struct NamedSolver {
  std::string_view name;
  Solve solve;
};
constexpr std::array kSolvers{
    NamedSolver{"gram", detail::solve_gram}, NamedSolver{"krylov", detail::solve_krylov},
    NamedSolver{"conjugate-gradient", detail::solve_conjugate_gradient},
    NamedSolver{"sta", detail::solve_sta}, NamedSolver{"joined", detail::solve_joined}};

/// An answer that may be farther from the true subspace is refused: the sine of 0.06°.
constexpr double kLargestSine = 1e-3;

/// Above so many views products with the views are quicker than the Gram matrix, whose cost grows with their
/// square (measured on two cores with AVX2). Integer products are quicker than those of floats.
constexpr std::size_t kGramViewsOfBytes = 4000;
constexpr std::size_t kGramViewsOfFloats = 2000;

std::string chosen_solver(const AppearanceSource& source, const SolverOptions& options) {
  if (options.solver != "auto") return options.solver;
  const std::size_t fixed = detail::gram_solver_memory(source.count(), source.length(), options.components);
  // Tiles of a fair size beside the Gram matrix, or every view is read many times.
  const bool fits = options.memory_limit == 0 || fixed <= options.memory_limit - options.memory_limit / 4;
  const std::size_t most = source.has_bytes() ? kGramViewsOfBytes : kGramViewsOfFloats;
  return fits && source.count() <= most ? "gram" : "krylov";
}

}  // namespace

Eigenspace solve_eigenspace(const AppearanceSource& source, const SolverOptions& options,
                            SolverReport* report, const Progress& progress, std::stop_token stop) {
  const SolverOptions bounded = detail::checked_options(source, options);
  const std::string name = chosen_solver(source, bounded);
  const auto* solver =
      std::find_if(kSolvers.begin(), kSolvers.end(), [&](const auto& s) { return s.name == name; });
  if (solver == kSolvers.end()) {
    std::string known = "auto";
    for (const auto& s : kSolvers) known += ", " + std::string(s.name);
    throw std::invalid_argument("unknown solver '" + options.solver + "'; known are " + known);
  }
  SolverReport result;
  result.solver = name;
  Eigenspace space = solver->solve({source, bounded, progress, std::move(stop)}, result);
  detail::complete_report(space, options, result);
  if (report != nullptr) *report = std::move(result);
  return space;
}

namespace detail {

SolverOptions checked_options(const AppearanceSource& source, const SolverOptions& options) {
  if (source.count() < 2) {
    throw std::invalid_argument("an eigenspace needs at least two views, there are " +
                                std::to_string(source.count()));
  }
  if (source.length() == 0) throw std::invalid_argument("the appearances have no numbers");
  if (options.components == 0) throw std::invalid_argument("components = 0: ask for at least one");
  if (options.energy && !(*options.energy > 0.0 && *options.energy <= 1.0)) {
    throw std::invalid_argument("energy = " + std::to_string(*options.energy) + ": it is a share in (0, 1]");
  }
  SolverOptions bounded = options;
  bounded.components = std::min({options.components, source.count() - 1, source.length()});
  return bounded;
}

void complete_report(const Eigenspace& space, const SolverOptions& asked, SolverReport& report) {
  report.components = static_cast<std::size_t>(space.components());
  report.energy =
      space.total_scatter > 0.0 ? std::min(1.0, space.eigenvalues.sum() / space.total_scatter) : 0.0;
  if (report.components < asked.components && !asked.energy) {
    if (!report.note.empty()) report.note += "; ";
    report.note += "the views span " + std::to_string(report.components) + " dimensions, " +
                   std::to_string(asked.components) + " were asked for";
  }
}

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
  report.residual_over_gap = residual_over_gap(pairs, kept);
  if (!(report.residual_over_gap <= kLargestSine)) {
    throw Error("the " + report.solver +
                " solver did not reach an accurate eigenspace: residual over eigenvalue gap is " +
                std::to_string(report.residual_over_gap) + ", at most " + std::to_string(kLargestSine) +
                " is accepted; use another number of components or the gram solver");
  }
  if (tied_cut(pairs, kept))
    report.note =
        "the last eigenvalue kept and the first left out are equal: the cut between them is one of many";
}

void check_rank(Eigen::Index rank) {
  if (rank == 0)
    throw Error("all views are the same image up to brightness: there is nothing to span; add other views");
}

}  // namespace detail
}  // namespace eigenpose
