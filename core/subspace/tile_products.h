#pragma once

/// Products of a block of views with dense vectors, in double. The result does not depend on the number of
/// threads.

#include <cstddef>

#include <Eigen/Core>

#include "core/subspace/view_reader.h"

namespace eigenpose {

/// Views that `add_weighted_views` packs at once: strips of a streamed source that are multiples of it do not
/// show in the result.
inline constexpr std::size_t kViewDepth = 32;

/// out += X · W, where row first + v of `weights` belongs to view v of the block. out is N × C.
void add_weighted_views(const ViewBlock& block, const Eigen::MatrixXd& weights, std::size_t first,
                        unsigned threads, Eigen::MatrixXd& out);

/// Xᵀ V: n × C for n views and N × C vectors.
Eigen::MatrixXd view_products(const ViewBlock& block, const Eigen::MatrixXd& vectors, unsigned threads);

}  // namespace eigenpose
