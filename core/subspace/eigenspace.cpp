#include "core/subspace/eigenspace.h"

#include <stdexcept>
#include <string>

namespace eigenpose {
namespace {

void check_size(const char* what, Eigen::Index found, Eigen::Index expected) {
  if (found != expected) {
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(found) +
                                " numbers, the eigenspace expects " + std::to_string(expected));
  }
}

}  // namespace

Eigen::VectorXf Eigenspace::project(const Eigen::Ref<const Eigen::VectorXf>& appearance) const {
  check_size("the appearance", appearance.size(), length());
  return basis.transpose() * (appearance - mean);
}

Eigen::VectorXf Eigenspace::reconstruct(const Eigen::Ref<const Eigen::VectorXf>& point) const {
  check_size("the point", point.size(), components());
  return mean + basis * point;
}

}  // namespace eigenpose
