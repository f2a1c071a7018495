#include "core/search/rbf_search.h"

#include <algorithm>
#include <numeric>

namespace eigenpose {

RbfSearch::RbfSearch(std::span<const Manifold> manifolds, const RbfOptions& options)
    : ManifoldSearch(manifolds), networks_(manifolds, options) {}

std::size_t RbfSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                    std::span<ClosestPoint> results, double bound) const {
  const Eigen::VectorXd exact = point.cast<double>();
  const Eigen::VectorXd scores = networks_.scores(exact);
  std::vector<std::size_t> order(manifolds().size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return scores[static_cast<Eigen::Index>(a)] > scores[static_cast<Eigen::Index>(b)];
  });
  std::size_t count = 0;
  for (const std::size_t object : order) {
    if (count == results.size()) break;
    const std::vector<double> q = networks_.pose(object, exact);
    const double distance = (exact - manifolds()[object].evaluate(q)).norm();
    if (distance > bound) {
      if (count == 0) break;  // the network's choice is beyond the bound: unknown
      continue;
    }
    ClosestPoint& found = results[count++];
    found = {object, {}, distance};
    std::copy(q.begin(), q.end(), found.q.begin());
  }
  return count;
}

std::size_t RbfSearch::memory() const {
  return networks_.memory();
}

}  // namespace eigenpose
