#pragma once

/// The product that projects appearances. The instructions are chosen at run time.

#include <Eigen/Core>

namespace eigenpose {

/// out = basisᵀ · x. @pre basis.rows() == x.size(), basis.cols() == out.size().
void project_onto(const Eigen::MatrixXf& basis, const Eigen::VectorXf& x, Eigen::Ref<Eigen::VectorXf> out);

/// The same of `count` ≤ most_projected appearances, one column each of x and out, to the last bit; the basis
/// comes out of memory once.
void project_onto(const Eigen::MatrixXf& basis, const Eigen::MatrixXf& x, Eigen::Index count,
                  Eigen::MatrixXf& out);
inline constexpr Eigen::Index most_projected = 8;

}  // namespace eigenpose
