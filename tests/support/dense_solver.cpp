#include "tests/support/dense_solver.h"

#include "core/subspace/back_projection.h"
#include "core/subspace/solvers.h"

namespace eigenpose::test {

Eigenspace dense_eigenspace(const AppearanceSource& source, std::size_t components) {
  SolverOptions asked;
  asked.components = components;
  const SolverOptions options = detail::checked_options(source, asked);
  Eigen::VectorXd mean;
  const Eigen::MatrixXd views = detail::centred_appearances(source, 0, source.count(), mean);
  const bool over_views = views.cols() <= views.rows();
  const Eigen::MatrixXd scatter =
      over_views ? Eigen::MatrixXd(views.transpose() * views) : Eigen::MatrixXd(views * views.transpose());
  const EigenPairs pairs = detail::full_eigenpairs(scatter, static_cast<Eigen::Index>(options.components),
                                                   detail::rounding_of_scatter(source.count()));
  detail::check_rank(pairs.values.size());
  Eigen::MatrixXd basis = pairs.vectors;
  if (over_views) basis = (views * basis).eval() * pairs.values.cwiseSqrt().cwiseInverse().asDiagonal();
  return finished_eigenspace(mean, basis, pairs.values, scatter.trace());
}

}  // namespace eigenpose::test
