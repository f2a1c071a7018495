#pragma once

/// How uncertain the numbers of a pose are together.

#include <cstddef>
#include <span>

#include <Eigen/Core>

namespace eigenpose {

/// Sets the covariance, row by row, to that of a pose of which nothing is to be seen: infinite variances.
/// @param covariance m × m numbers.
void set_unseen(std::size_t dofs, std::span<double> covariance);

/// Sets the m × m numbers of `covariance`, row by row, to variance · information⁻¹. Where that cannot be
/// inverted, each DOF stands for itself; one without information has infinite variance.
/// @param information m × m: products of the derivatives of a point. @param variance of each of its numbers.
void set_covariance(const Eigen::MatrixXd& information, double variance, std::span<double> covariance);

}  // namespace eigenpose
