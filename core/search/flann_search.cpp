#include "core/search/flann_search.h"

#include <cmath>

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>
#include <flann/util/result_set.h>

#include "core/search/best_list.h"
#include "core/search/sample_cloud.h"

namespace eigenpose {

namespace {

using Index = flann::KDTreeSingleIndex<flann::L2<float>>;

/// The nearest sample.
class NearestSample final : public flann::ResultSet<float> {
 public:
  [[nodiscard]] bool full() const override { return true; }
  void addPoint(float distance, size_t index) override {
    if (distance >= squared) return;
    squared = distance;
    sample = index;
  }
  [[nodiscard]] float worstDist() const override { return squared; }

  float squared = std::numeric_limits<float>::infinity();
  std::size_t sample = 0;
};

/// All samples within a radius.
class SamplesWithin final : public flann::ResultSet<float> {
 public:
  SamplesWithin(float squared_radius, std::vector<NearSample>& out) : squared_(squared_radius), out_(out) {}
  [[nodiscard]] bool full() const override { return true; }
  void addPoint(float distance, size_t index) override {
    if (distance < squared_) out_.push_back({distance, static_cast<std::uint32_t>(index)});
  }
  [[nodiscard]] float worstDist() const override { return squared_; }

 private:
  float squared_;
  std::vector<NearSample>& out_;
};

SampleMemory& sample_memory() {
  thread_local SampleMemory memory;
  return memory;
}

}  // namespace

struct FlannSearch::Impl {
  explicit Impl(std::span<const Manifold> manifolds)
      : patches(manifolds),
        cloud(patches),
        index(flann::Matrix<float>(cloud.points().data(), cloud.size(), cloud.dimensions()),
              flann::KDTreeSingleIndexParams(10, true)) {
    index.buildIndex();
  }
  PatchSet patches;
  SampleCloud cloud;
  Index index;
};

FlannSearch::FlannSearch(std::span<const Manifold> manifolds)
    : ManifoldSearch(manifolds), impl_(std::make_unique<Impl>(manifolds)) {}
FlannSearch::~FlannSearch() = default;

std::size_t FlannSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                      std::span<ClosestPoint> results, double bound) const {
  QueryMemory& memory = begin_query(point, impl_->patches.dimensions(), results.size());
  if (results.empty()) return 0;
  BestList best(std::span(memory.slots).first(results.size()), bound);
  const flann::SearchParams parameters(flann::FLANN_CHECKS_UNLIMITED, 0.0F);
  SampleMemory& samples = sample_memory();
  NearestSample nearest;
  const double farthest = bound + impl_->cloud.largest_reach();
  nearest.squared = static_cast<float>(farthest * farthest);
  impl_->index.findNeighbors(nearest, point.data(), parameters);
  // Its distance bounds that of the manifold; the certificate asks for what lies up to a reach beyond.
  const double start = std::min(std::sqrt(static_cast<double>(nearest.squared)), bound);
  const double radius_at_first = start * (1.0 + 1e-6) + impl_->cloud.largest_reach();
  search_samples(impl_->cloud, impl_->patches, {memory.point.data(), radius_at_first, bound}, best, samples,
                 [&](double radius) {
                   SamplesWithin within(static_cast<float>(radius * radius * (1.0 + 1e-6)), samples.near);
                   impl_->index.findNeighbors(within, point.data(), parameters);
                 });
  return finish_query(impl_->patches, best, memory.point.data(), results);
}

std::size_t FlannSearch::memory() const {
  // FLANN keeps a reordered copy of the points.
  return impl_->patches.memory() + impl_->cloud.memory() +
         static_cast<std::size_t>(impl_->index.usedMemory()) + impl_->cloud.points().size_bytes();
}

}  // namespace eigenpose
