// Closest point on 100 and 1000 manifolds: the searches side by side, in one run.
//
//   search_bench [queries] [search]   a table per world: microseconds per query, median / 99 %
//                                     (4000 queries, all searches)
//
// Per query the best of three passes over all queries; percentiles are over queries. With EIGENPOSE_DATASETS
// set, real views of COIL-100 follow. The peer "flann+refine" is FLANN's exact single tree on 360 samples an
// object, then the exact closest point on the sample's segment and its two neighbours: what one would build
// without a certificate.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>
#include <string_view>

#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_single_index.h>
#include <flann/util/result_set.h>

#include "core/search/best_list.h"
#include "core/search/search.h"
#include "tests/bench/search_worlds.h"

namespace eigenpose::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// FLANN on samples, then refinement near the best one: no certificate.
class FlannPeer final : public ManifoldSearch {
 public:
  static constexpr int samples_per_segment = 10;

  explicit FlannPeer(std::span<const Manifold> list) : ManifoldSearch(list), patches_(list) {
    for (const Manifold& f : list) {
      const AxisBasis& basis = f.bases()[0];
      for (std::size_t s = 0; s < basis.segments(); ++s)
        for (int i = 0; i < samples_per_segment; ++i) {
          const double q = basis.position({s, (i + 0.5) / samples_per_segment});
          const Eigen::VectorXf v = f.evaluate({{q}}).cast<float>();
          points_.insert(points_.end(), v.data(), v.data() + v.size());
        }
    }
    const auto k = static_cast<std::size_t>(list[0].dimensions());
    index_ = std::make_unique<flann::KDTreeSingleIndex<flann::L2<float>>>(
        flann::Matrix<float>(points_.data(), points_.size() / k, k),
        flann::KDTreeSingleIndexParams(10, true));
    index_->buildIndex();
  }

  [[nodiscard]] std::size_t nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                         std::span<ClosestPoint> results, double bound) const override {
    QueryMemory& memory = begin_query(point, patches_.dimensions(), results.size());
    BestList best(std::span(memory.slots).first(1), bound);
    Nearest nearest;
    nearest.squared = static_cast<float>(bound * bound);
    const flann::SearchParams parameters(flann::FLANN_CHECKS_UNLIMITED, 0.0F);
    index_->findNeighbors(nearest, point.data(), parameters);
    if (!nearest.found) return 0;
    const std::size_t patch = nearest.sample / samples_per_segment;
    const std::size_t segments = manifolds()[0].bases()[0].segments();
    const std::size_t first = patch / segments * segments;
    for (const std::size_t turn : {std::size_t{0}, std::size_t{1}, segments - 1}) {
      PatchPoint found;
      if (patches_.closest(first + (patch - first + turn) % segments, memory.point.data(), best.cut(), found))
        best.offer(found);
    }
    return finish_query(patches_, best, memory.point.data(), results);
  }
  [[nodiscard]] std::string_view name() const override { return "flann+refine"; }
  [[nodiscard]] std::size_t memory() const override {
    return 2 * points_.size() * sizeof(float) + static_cast<std::size_t>(index_->usedMemory());
  }

 private:
  struct Nearest final : flann::ResultSet<float> {
    [[nodiscard]] bool full() const override { return true; }
    void addPoint(float distance, std::size_t index) override {
      if (distance >= squared) return;
      squared = distance;
      sample = index;
      found = true;
    }
    [[nodiscard]] float worstDist() const override { return squared; }
    float squared = 0.0F;
    std::size_t sample = 0;
    bool found = false;
  };
  PatchSet patches_;
  std::vector<float> points_;
  std::unique_ptr<flann::KDTreeSingleIndex<flann::L2<float>>> index_;
};

struct Times {
  double median = 0.0;
  double p99 = 0.0;
};

/// µs per query: the best of three passes each, then percentiles.
Times measure(const ManifoldSearch& search, const std::vector<Eigen::VectorXf>& points, double bound,
              std::size_t count) {
  std::vector<double> best(points.size(), std::numeric_limits<double>::infinity());
  std::vector<ClosestPoint> results(count);
  std::size_t found = 0;
  for (int pass = 0; pass < 3; ++pass)
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto start = Clock::now();
      found += search.nearest_into(points[i], results, bound);
      best[i] = std::min(best[i], 1e6 * seconds_since(start));
    }
  if (found > 3 * points.size() * count) std::abort();
  std::sort(best.begin(), best.end());
  return {best[best.size() / 2], best[best.size() * 99 / 100]};
}

void run(const SearchWorld& world, std::string_view only) {
  std::printf(
      "\n%s, %zu manifolds, K=20, 36 views each; rejection distance %.4f; µs per query, median / 99 %%\n",
      world.name.c_str(), world.manifolds.size(), world.rejection_distance);
  std::printf("%-14s %17s %17s %17s %17s %17s %9s %8s\n", "bounded:", "known", "perturbed", "unknown",
              "known, best 2", "unknown, no bound", "memory", "build");
  const auto row = [&](std::string_view name, const std::function<std::unique_ptr<ManifoldSearch>()>& make,
                       bool two) {
    if (!only.empty() && only != name) return;
    const auto start = Clock::now();
    const auto search = make();
    const double build = seconds_since(start);
    std::printf("%-14s", std::string(name).c_str());
    const auto cell = [&](const std::vector<Eigen::VectorXf>& points, double bound, std::size_t count) {
      const Times t = measure(*search, points, bound, count);
      std::printf(" %8.2f /%7.2f", t.median, t.p99);
      std::fflush(stdout);
    };
    const double bound = world.rejection_distance;
    cell(world.known, bound, 1);
    cell(world.perturbed, bound, 1);
    cell(world.unknown, bound, 1);
    if (two)
      cell(world.known, bound, 2);
    else
      std::printf(" %17s", "-");
    if (name == "slab")  // Without a bound every sample is a candidate: minutes.
      std::printf(" %17s", "-");
    else
      cell(world.unknown, std::numeric_limits<double>::infinity(), 1);
    std::printf(" %6.1f MB %6.2f s\n", static_cast<double>(search->memory()) / 1e6, build);
  };
  row(
      "tree", [&] { return make_search("tree", world.manifolds); }, true);
  row(
      "flann+refine", [&] { return std::make_unique<FlannPeer>(world.manifolds); }, false);
  row(
      "flann", [&] { return make_search("flann", world.manifolds); }, true);
  row(
      "slab", [&] { return make_search("slab", world.manifolds); }, true);
}

}  // namespace
}  // namespace eigenpose::bench

int main(int count, char** arguments) {
  using namespace eigenpose::bench;
  const std::size_t queries = count > 1 ? std::strtoul(arguments[1], nullptr, 10) : 4000;
  const std::string_view only = count > 2 ? arguments[2] : "";
  for (const std::size_t objects : {100, 1000}) run(synthetic_world(objects, queries), only);
  const char* datasets = std::getenv("EIGENPOSE_DATASETS");
  if (datasets == nullptr || *datasets == '\0') {
    std::printf("\nEIGENPOSE_DATASETS is not set: COIL-100 was not measured.\n");
    return 0;
  }
  for (const std::size_t objects : {100, 1000})
    run(coil_world(std::filesystem::path(datasets) / "coil-100-half", objects, queries), only);
}
