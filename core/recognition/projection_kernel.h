#pragma once

/// The product that projects one appearance. The instructions are chosen at run time.

#include <Eigen/Core>

namespace eigenpose {

/// out = basisᵀ · x. @pre basis.rows() == x.size(), basis.cols() == out.size().
void project_onto(const Eigen::MatrixXf& basis, const Eigen::VectorXf& x, Eigen::Ref<Eigen::VectorXf> out);

}  // namespace eigenpose
