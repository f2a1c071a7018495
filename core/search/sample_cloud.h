#pragma once

/// Manifolds resampled as points, with how much each point stands for: what FLANN and the slab search look
/// through.
///
/// Sample i lies in the middle of its cell of a patch; no point of the cell is farther from it than reach(i),
/// the largest distance to the Bézier points of the cell (convex hull). So where a manifold comes within d of
/// a query, one of its samples comes within d + reach: looking through all samples that near and solving
/// their patches exactly is exact on the continuous manifold. That is the certificate of both searches.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/search/best_list.h"
#include "core/search/patch_set.h"

namespace eigenpose {

class SampleCloud {
 public:
  /// Ten samples per segment of a curve; fewer per axis of a patch.
  explicit SampleCloud(const PatchSet& patches);

  [[nodiscard]] std::size_t size() const { return patch_.size(); }
  [[nodiscard]] std::size_t dimensions() const { return dimensions_; }
  [[nodiscard]] std::span<const float> point(std::size_t i) const {
    return std::span(points_).subspan(i * dimensions_, dimensions_);
  }
  [[nodiscard]] std::span<float> points() { return points_; }  ///< all, one after the other
  [[nodiscard]] std::size_t patch(std::size_t i) const { return patch_[i]; }
  [[nodiscard]] double reach(std::size_t i) const { return static_cast<double>(reach_[i]); }
  [[nodiscard]] double largest_reach() const { return largest_reach_; }
  [[nodiscard]] std::size_t memory() const;

 private:
  std::size_t dimensions_ = 0;
  std::vector<float> points_;
  std::vector<std::uint32_t> patch_;
  std::vector<float> reach_;
  double largest_reach_ = 0.0;
};

/// A sample near the query.
struct NearSample {
  float squared_distance = 0.0F;
  std::uint32_t sample = 0;
};

/// Memory of one thread for search_samples().
struct SampleMemory {
  std::vector<NearSample> near;
  std::vector<std::uint32_t> solved;  ///< per patch, the query that solved it last
  std::uint32_t query = 0;
};

/// What search_samples() looks for.
struct SampleQuery {
  const double* point;  ///< K numbers
  double radius;        ///< to begin with
  double bound;         ///< what lies farther does not count
};

/// Exact search by samples. `collect(radius)` appends to `memory.near` every sample within `radius`. The
/// radius grows until the certificate holds: everything within the best distance plus the largest reach has
/// been looked at.
template <typename Collect>
void search_samples(const SampleCloud& cloud, const PatchSet& patches, const SampleQuery& query,
                    BestList& best, SampleMemory& memory, const Collect& collect) {
  double radius = query.radius;
  if (memory.solved.size() < patches.size()) memory.solved.resize(patches.size(), 0);
  if (++memory.query == 0) {
    std::fill(memory.solved.begin(), memory.solved.end(), 0U);
    memory.query = 1;
  }
  for (;;) {
    memory.near.clear();
    collect(radius);
    std::sort(memory.near.begin(), memory.near.end(), [](const NearSample& a, const NearSample& b) {
      return a.squared_distance < b.squared_distance;
    });
    for (const NearSample& near : memory.near) {
      const std::size_t patch = cloud.patch(near.sample);
      if (memory.solved[patch] == memory.query) continue;
      const double distance =
          std::sqrt(static_cast<double>(near.squared_distance)) - cloud.reach(near.sample);
      if (distance > 0.0 && distance * distance > best.cut()) continue;
      memory.solved[patch] = memory.query;
      PatchPoint found;
      if (patches.closest(patch, query.point, best.cut(), found)) best.offer(found);
    }
    // Float rounding of the samples is part of their reach.
    const double wanted = std::sqrt(best.cut()) + cloud.largest_reach();
    if (wanted <= radius || radius > query.bound + cloud.largest_reach() ||
        memory.near.size() == cloud.size())
      return;
    radius = std::isfinite(wanted) ? wanted : 2.0 * radius;
  }
}

}  // namespace eigenpose
