#pragma once

/// The product that projects appearances onto an eigenspace (eq. 9), in float. Thread-safe.
///
/// Exactness: as `dot` of core/simd/dense_products.h. The same machine gives the same bits each time.

#include <Eigen/Core>

namespace eigenpose {

/// out = basisᵀ · x. @pre basis.rows() == x.size(), basis.cols() == out.size().
void project_onto(const Eigen::MatrixXf& basis, const Eigen::VectorXf& x, Eigen::Ref<Eigen::VectorXf> out);

/// The same of the first `count` ≤ most_projected columns of x into those of `out`, to the last bit; the
/// basis comes out of memory once. @pre basis.rows() == x.rows(), basis.cols() == out.rows().
void project_onto(const Eigen::MatrixXf& basis, const Eigen::MatrixXf& x, Eigen::Index count,
                  Eigen::MatrixXf& out);
inline constexpr Eigen::Index most_projected = 8;

}  // namespace eigenpose
