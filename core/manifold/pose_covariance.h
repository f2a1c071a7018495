#pragma once

/// How uncertain the numbers of a pose are together.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace eigenpose {

/// The covariance of a pose of which nothing is to be seen: m × m numbers, row by row, infinite variances.
std::vector<double> unseen_pose(std::size_t dofs);

/// Sets the m × m numbers of `covariance`, row by row, to variance · information⁻¹. Where that cannot be
/// inverted, each DOF stands for itself; one without information has infinite variance.
/// @param information m × m: products of the derivatives of a point. @param variance of each of its numbers.
void set_covariance(const Eigen::MatrixXd& information, double variance, std::vector<double>& covariance);

}  // namespace eigenpose
