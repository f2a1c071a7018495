#include "core/evaluation/resemblance.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/base/parallel.h"
#include "core/recognition/decision.h"
#include "core/recognition/manifold_samples.h"
#include "core/search/search.h"

namespace eigenpose {
namespace {

/// So many of the objects nearest to a view are looked at.
constexpr std::size_t most_near = 16;

void sort_by_distance(std::vector<Resemblance>& found) {
  std::stable_sort(found.begin(), found.end(),
                   [](const Resemblance& a, const Resemblance& b) { return a.distance < b.distance; });
}

/// What the views of object `o` would pass for, one entry a pair.
std::vector<Resemblance> seen_from(const Model& model, const ManifoldSearch& search, std::size_t o,
                                   double reach) {
  const ManifoldSamples table(model.objects[o].manifold);
  std::map<std::size_t, Resemblance> by_other;
  std::vector<ClosestPoint> near(std::min(most_near, model.objects.size()));
  for (std::size_t s = 0; s < table.samples(); ++s) {
    const std::size_t count = search.nearest_into(table.point(s), near, reach);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t other = near[i].manifold;
      if (other == o || near[i].distance > model.rejection_distance(other)) continue;
      auto [at, first_time] = by_other.try_emplace(other);
      Resemblance& pair = at->second;
      pair.share += 1.0 / static_cast<double>(table.samples());
      if (!first_time && near[i].distance >= pair.distance) continue;
      pair.first = o;
      pair.second = other;
      pair.distance = near[i].distance;
      pair.first_q = table.pose(s);
      pair.second_q.assign(near[i].q.begin(), near[i].q.begin() + static_cast<std::ptrdiff_t>(
                                                                      model.objects[other].workspace.size()));
    }
  }
  std::vector<Resemblance> found;
  found.reserve(by_other.size());
  for (auto& [other, pair] : by_other) found.push_back(std::move(pair));
  return found;
}

}  // namespace

std::vector<Resemblance> alike_objects(const Model& model, unsigned threads) {
  std::vector<Manifold> manifolds;
  double reach = 0.0;
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    manifolds.push_back(model.objects[o].manifold);
    reach = std::max(reach, model.rejection_distance(o));
  }
  const auto search = make_search("tree", manifolds);
  std::vector<std::vector<Resemblance>> seen(model.objects.size());
  parallel_for(seen.size(), threads, [&](std::size_t o) { seen[o] = seen_from(model, *search, o, reach); });
  // Each pair once, from the side where more looks alike.
  std::map<std::pair<std::size_t, std::size_t>, Resemblance> pairs;
  for (std::vector<Resemblance>& own : seen)
    for (Resemblance& pair : own) {
      auto [at, first_time] = pairs.try_emplace(std::minmax(pair.first, pair.second));
      const double share = std::max(at->second.share, pair.share);
      if (first_time || pair.distance < at->second.distance) at->second = std::move(pair);
      at->second.share = share;
    }
  std::vector<Resemblance> found;
  found.reserve(pairs.size());
  for (auto& [objects, pair] : pairs) found.push_back(std::move(pair));
  sort_by_distance(found);
  return found;
}

std::vector<Resemblance> alike_poses(const Model& model, unsigned threads) {
  std::vector<Resemblance> all(model.objects.size());
  parallel_for(all.size(), threads, [&](std::size_t o) {
    const ModelObject& object = model.objects[o];
    const ManifoldSamples table(object.manifold);
    Eigen::VectorXf squared;
    std::vector<double> other_q(table.dofs());
    Resemblance& worst = all[o];
    worst.first = worst.second = o;
    for (std::size_t s = 0; s < table.samples(); ++s) {
      const std::vector<double> q = table.pose(s);
      const auto other = table.other_minimum(table.point(s), q, poses_apart, other_q, squared);
      if (!other || other->distance > model.objects[o].typical_distance) continue;
      if (worst.share == 0.0 || other->distance < worst.distance) {
        worst.distance = other->distance;
        worst.first_q = q;
        worst.second_q = other_q;
      }
      worst.share += 1.0 / static_cast<double>(table.samples());
    }
  });
  std::erase_if(all, [](const Resemblance& one) { return one.share == 0.0; });
  sort_by_distance(all);
  return all;
}

}  // namespace eigenpose
