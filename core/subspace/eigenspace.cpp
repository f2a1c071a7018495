#include "core/subspace/eigenspace.h"

#include <stdexcept>
#include <string>

namespace eigenpose {
Eigen::VectorXf Eigenspace::project(const Eigen::Ref<const Eigen::VectorXf>& appearance) const {
  if (appearance.size() != length())
    throw std::invalid_argument("the appearance has " + std::to_string(appearance.size()) +
                                " components, the eigenspace expects " + std::to_string(length()));
  return basis.transpose() * (appearance - mean);
}

}  // namespace eigenpose
