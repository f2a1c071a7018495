#include "core/search/slab_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace eigenpose {

namespace {

/// Dimensions by which candidates are trimmed before they are measured; more cost more than they save.
constexpr std::size_t trims = 6;

}  // namespace

/// The memory of one thread.
struct SlabMemory {
  struct Interval {
    std::uint32_t first = 0;  ///< ranks [first, last)
    std::uint32_t last = 0;
    std::uint32_t dimension = 0;
  };

  SampleMemory samples;
  std::vector<Interval> intervals;
  std::vector<std::uint32_t> candidates;
};

SlabSearch::SlabSearch(std::span<const Manifold> manifolds)
    : ManifoldSearch(manifolds), patches_(manifolds), cloud_(patches_) {
  const std::size_t n = cloud_.size();
  const std::size_t dims = cloud_.dimensions();
  sorted_.resize(dims * n);
  backward_.resize(dims * n);
  forward_.resize(dims * n);
  for (std::size_t d = 0; d < dims; ++d) {
    const std::span<std::uint32_t> backward = std::span(backward_).subspan(d * n, n);
    std::iota(backward.begin(), backward.end(), 0U);
    std::sort(backward.begin(), backward.end(),
              [&](std::uint32_t a, std::uint32_t b) { return cloud_.point(a)[d] < cloud_.point(b)[d]; });
    for (std::size_t rank = 0; rank < n; ++rank) {
      sorted_[d * n + rank] = cloud_.point(backward[rank])[d];
      forward_[d * n + backward[rank]] = static_cast<std::uint32_t>(rank);
    }
  }
  first_radius_ = 2.0 * cloud_.largest_reach();
}

/// All samples within the cube that are also within the radius, with their distances.
void SlabSearch::collect(const float* point, double radius, SlabMemory& memory) const {
  const std::size_t n = cloud_.size();
  const std::size_t dims = cloud_.dimensions();
  // A little wider than asked for: the ends are rounded to float.
  const auto half = static_cast<float>(radius * (1.0 + 1e-6) + 1e-30);
  memory.intervals.clear();
  for (std::size_t d = 0; d < dims; ++d) {
    const auto begin = sorted_.begin() + static_cast<std::ptrdiff_t>(d * n);
    const auto end = begin + static_cast<std::ptrdiff_t>(n);
    const float rounding = 1e-6F * std::abs(point[d]);
    const auto first = std::lower_bound(begin, end, point[d] - half - rounding);
    const auto last = std::upper_bound(first, end, point[d] + half + rounding);
    if (first == last) return;
    memory.intervals.push_back({static_cast<std::uint32_t>(first - begin),
                                static_cast<std::uint32_t>(last - begin), static_cast<std::uint32_t>(d)});
  }
  const std::size_t used = std::min(trims, dims);
  std::partial_sort(memory.intervals.begin(), memory.intervals.begin() + static_cast<std::ptrdiff_t>(used),
                    memory.intervals.end(),
                    [](const auto& a, const auto& b) { return a.last - a.first < b.last - b.first; });
  const SlabMemory::Interval& narrowest = memory.intervals[0];
  const auto backward = backward_.begin() + static_cast<std::ptrdiff_t>(narrowest.dimension * n);
  memory.candidates.assign(backward + narrowest.first, backward + narrowest.last);
  std::size_t count = memory.candidates.size();
  for (std::size_t t = 1; t < used; ++t) {
    const SlabMemory::Interval& interval = memory.intervals[t];
    const std::uint32_t* forward = forward_.data() + interval.dimension * n;
    const std::uint32_t width = interval.last - interval.first;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t candidate = memory.candidates[i];
      memory.candidates[kept] = candidate;
      kept += static_cast<std::size_t>(forward[candidate] - interval.first < width);
    }
    count = kept;
  }
  const auto limit = static_cast<float>(radius * radius * (1.0 + 1e-5));
  for (std::size_t i = 0; i < count; ++i) {
    const std::span<const float> sample = cloud_.point(memory.candidates[i]);
    float sum = 0.0F;
    for (std::size_t d = 0; d < dims; ++d) sum += (point[d] - sample[d]) * (point[d] - sample[d]);
    if (sum <= limit) memory.samples.near.push_back({sum, memory.candidates[i]});
  }
}

std::size_t SlabSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                     std::span<ClosestPoint> results, double bound) const {
  QueryMemory& memory = begin_query(point, patches_.dimensions(), results.size());
  if (results.empty()) return 0;
  thread_local SlabMemory slabs;
  BestList best(std::span(memory.slots).first(results.size()), bound);
  const double start = std::min(first_radius_, bound + cloud_.largest_reach());
  search_samples(cloud_, patches_, {memory.point.data(), start, bound}, best, slabs.samples,
                 [&](double radius) { collect(point.data(), radius, slabs); });
  return finish_query(patches_, best, memory.point.data(), results);
}

std::size_t SlabSearch::memory() const {
  return patches_.memory() + cloud_.memory() + sorted_.capacity() * sizeof(float) +
         (backward_.capacity() + forward_.capacity()) * sizeof(std::uint32_t);
}

}  // namespace eigenpose
