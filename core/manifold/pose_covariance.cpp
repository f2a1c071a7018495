#include "core/manifold/pose_covariance.h"

#include <algorithm>
#include <limits>

#include "core/base/linear_algebra.h"

namespace eigenpose {

void set_unseen(std::size_t dofs, std::span<double> covariance) {
  std::fill(covariance.begin(), covariance.end(), 0.0);
  for (std::size_t d = 0; d < dofs; ++d) covariance[d * dofs + d] = std::numeric_limits<double>::infinity();
}

void set_covariance(const Eigen::MatrixXd& information, double variance, std::span<double> covariance) {
  const Eigen::Index m = information.rows();
  set_unseen(static_cast<std::size_t>(m), covariance);
  const auto at = [&](Eigen::Index row, Eigen::Index column) -> double& {
    return covariance[static_cast<std::size_t>(row * m + column)];
  };
  const auto inverse = inverse_of(information);
  const bool good = inverse && (inverse->diagonal().array() > 0.0).all();
  for (Eigen::Index a = 0; a < m; ++a) {
    if (!good && information(a, a) > 0.0) at(a, a) = variance / information(a, a);
    for (Eigen::Index b = 0; b < m && good; ++b) at(a, b) = variance * (*inverse)(a, b);
  }
}

}  // namespace eigenpose
