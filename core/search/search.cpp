#include "core/search/search.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "core/search/best_list.h"
#include "core/search/flann_search.h"
#include "core/search/rbf_search.h"
#include "core/search/slab_search.h"
#include "core/search/tree_search.h"

namespace eigenpose {

std::vector<Closest> ManifoldSearch::nearest(const Eigen::Ref<const Eigen::VectorXf>& point,
                                             std::size_t count, double bound) const {
  std::vector<ClosestPoint> points(std::min(count, manifolds_.size()));
  points.resize(nearest_into(point, points, bound));
  std::vector<Closest> result;
  result.reserve(points.size());
  for (const ClosestPoint& p : points) {
    const auto m = static_cast<std::ptrdiff_t>(manifolds_[p.manifold].dofs());
    result.push_back({p.manifold, {p.q.begin(), p.q.begin() + m}, p.distance});
  }
  return result;
}

std::unique_ptr<ManifoldSearch> make_search(std::string_view kind, std::span<const Manifold> manifolds) {
  if (kind == "tree") return std::make_unique<TreeSearch>(manifolds);
  if (kind == "flann") return std::make_unique<FlannSearch>(manifolds);
  if (kind == "slab") return std::make_unique<SlabSearch>(manifolds);
  if (kind == "rbf") return std::make_unique<RbfSearch>(manifolds);
  throw std::invalid_argument("unknown search \"" + std::string(kind) + "\": tree, flann, slab or rbf");
}

std::unique_ptr<ManifoldSearch> make_search(std::span<const Manifold> manifolds) {
  return make_search("tree", manifolds);
}

QueryMemory& query_memory() {
  thread_local QueryMemory memory;
  return memory;
}

QueryMemory& begin_query(const Eigen::Ref<const Eigen::VectorXf>& point, std::size_t dimensions,
                         std::size_t count) {
  if (static_cast<std::size_t>(point.size()) != dimensions)
    throw std::invalid_argument("the manifolds have " + std::to_string(dimensions) +
                                " dimensions, the point has " + std::to_string(point.size()));
  QueryMemory& memory = query_memory();
  if (memory.point.size() < dimensions) memory.point.resize(dimensions);
  if (memory.slots.size() < count) memory.slots.resize(count);
  for (std::size_t i = 0; i < dimensions; ++i)
    memory.point[i] = static_cast<double>(point[static_cast<Eigen::Index>(i)]);
  return memory;
}

std::size_t finish_query(const PatchSet& patches, const BestList& best, const double* point,
                         std::span<ClosestPoint> results) {
  const std::span<const PatchPoint> found = best.found();
  // Rounding of a squared distance is about 1e-15: below 1e-8 its root would not be good to 1e-9.
  for (std::size_t i = 0; i < found.size(); ++i)
    results[i] = {found[i].manifold, patches.position(found[i]),
                  found[i].squared_distance > 1e-8 ? std::sqrt(found[i].squared_distance)
                                                   : patches.distance(found[i], point)};
  return found.size();
}

}  // namespace eigenpose
