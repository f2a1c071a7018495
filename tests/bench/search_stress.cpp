// Every search against the oracle, on many queries.
//
//   search_stress [queries] [threads] [seed] [share]     (10 million, all cores, 0, 0.002)
//
// Lists of a few manifolds with random K, samples, degrees, closed and open, uniform and jittered, twins
// among them; queries near, far, on knots, at seams and between two manifolds. `share` of the queries are
// about manifolds of several DOFs: of these 3/4 of two, 1/5 of three and the rest of four. With
// EIGENPOSE_DATASETS set, 1 % of the queries are real views of COIL-100, moved a little at random. Says how
// far it is ten times a run, and each difference where it happens. Ends with status 1 where a search differs
// from the oracle by more than 1e-5, or names another manifold although the difference is clear.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <random>
#include <string>

#include "core/base/parallel.h"
#include "core/search/search.h"
#include "tests/bench/search_worlds.h"
#include "tests/core/search/search_queries.h"
#include "tests/support/exhaustive_search.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

constexpr double promised = 1e-5;
constexpr std::size_t queries_per_list = 5000;
constexpr std::size_t queries_per_patch_list = 40;
const char* const kinds[] = {"tree", "flann", "slab"};

struct Tally {
  std::mutex mutex;
  std::atomic<std::size_t> queries{0};
  std::array<std::atomic<std::size_t>, max_manifold_dofs + 1> of_dofs{};  ///< queries about lists of m DOFs
  std::atomic<std::size_t> missed_by_oracle{0};  ///< answers of searches that are nearer, and really there
  std::size_t wrong[3] = {0, 0, 0};
  double worst[3] = {0.0, 0.0, 0.0};
};

std::vector<Manifold> random_list(std::size_t dofs, std::mt19937& random) {
  const auto number = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  // As learning demands it: fewer dimensions than that, and manifolds fill their space.
  const Eigen::Index dimensions = number(static_cast<int>(dofs) + 1, 24);
  const int most = dofs == 1 ? 16 : dofs == 2 ? 10 : dofs == 3 ? 6 : 4;
  std::vector<Manifold> list;
  for (int i = number(2, dofs > 2 ? 3 : 5); i > 0; --i) {
    std::vector<SampleAxis> axes = {
        synthetic::axis("a", number(4, most), number(0, 3) != 0, number(0, 1) == 1, random)};
    // Two values make an axis of degree 1: its segments join with a bend.
    while (axes.size() < dofs) {
      const bool second = axes.size() == 1;
      const bool closed = second && number(0, 3) == 0;
      const int samples = number(second && !closed ? 2 : 3, dofs == 2 ? 5 : 4);
      axes.push_back(synthetic::axis("b", samples, closed, number(0, 1) == 1, random));
    }
    list.push_back(synthetic::smooth_manifold(axes, dimensions, 2, random, number(1, 4)));
  }
  if (number(0, 3) == 0) list.push_back(Manifold(list[0]));
  return list;
}

/// One oracle and the searches over one list.
class Comparison {
 public:
  /// @param name what the list is called where a search is wrong.
  Comparison(std::span<const Manifold> list, std::string name, Tally& tally)
      : tally_(tally), name_(std::move(name)), oracle_(std::make_unique<ExhaustiveSearch>(list)) {
    for (const char* kind : kinds) searches_.push_back(make_search(kind, list));
  }
  ~Comparison() {
    const std::lock_guard lock(tally_.mutex);
    for (std::size_t k = 0; k < 3; ++k) {
      tally_.wrong[k] += wrong_[k];
      tally_.worst[k] = std::max(tally_.worst[k], worst_[k]);
    }
  }
  void ask(const Eigen::VectorXf& point, double bound) {
    ClosestPoint truth[2];
    const std::size_t expected = oracle_->nearest_into(point, truth, bound);
    for (std::size_t k = 0; k < searches_.size(); ++k) {
      ClosestPoint found;
      const std::size_t count = searches_[k]->nearest_into(point, {&found, 1}, bound);
      // On the bound itself either answer is right.
      if (count != std::min<std::size_t>(expected, 1)) {
        const double edge = expected > 0 ? truth[0].distance : found.distance;
        if (std::abs(edge - bound) > promised)
          count_wrong(k, expected > 0 ? truth[0] : ClosestPoint{}, found);
        continue;
      }
      if (count == 0) continue;
      if (found.distance < truth[0].distance - promised && is_there(found, point)) {
        ++tally_.missed_by_oracle;
        continue;
      }
      const double difference = std::abs(found.distance - truth[0].distance);
      worst_[k] = std::max(worst_[k], difference);
      const bool clear = expected < 2 || truth[1].distance - truth[0].distance > 2.0 * promised;
      if (difference > promised || (clear && found.manifold != truth[0].manifold))
        count_wrong(k, truth[0], found);
    }
    ++asked_;
    ++tally_.queries;
    ++tally_.of_dofs[oracle_->manifolds()[0].dofs()];
  }

 private:
  void count_wrong(std::size_t k, const ClosestPoint& truth, const ClosestPoint& found) {
    ++wrong_[k];
    std::printf("different: %s, query %zu: %s says manifold %zu at %.9g, the oracle %zu at %.9g\n",
                name_.c_str(), asked_, kinds[k], found.manifold, found.distance, truth.manifold,
                truth.distance);
  }
  /// Whether the manifold really comes that near: the oracle starts from a grid, which can be too coarse for
  /// surfaces through very few samples.
  [[nodiscard]] bool is_there(const ClosestPoint& found, const Eigen::VectorXf& point) const {
    const Manifold& f = oracle_->manifolds()[found.manifold];
    const Eigen::VectorXd value = f.evaluate(std::span(found.q).first(f.dofs()));
    return std::abs((point.cast<double>() - value).norm() - found.distance) < promised;
  }

  Tally& tally_;
  std::string name_;
  std::size_t asked_ = 0;
  std::unique_ptr<ManifoldSearch> oracle_;
  std::vector<std::unique_ptr<ManifoldSearch>> searches_;
  std::size_t wrong_[3] = {0, 0, 0};
  double worst_[3] = {0.0, 0.0, 0.0};
};

double random_bound(std::mt19937& random) {
  const int which = std::uniform_int_distribution<int>(0, 3)(random);
  return which == 0 ? 0.1 : which == 1 ? 0.5 : std::numeric_limits<double>::infinity();
}

}  // namespace
}  // namespace eigenpose

int main(int count, char** arguments) {
  using namespace eigenpose;
  const std::size_t wanted = count > 1 ? std::strtoul(arguments[1], nullptr, 10) : 10'000'000;
  const auto threads = static_cast<unsigned>(count > 2 ? std::strtoul(arguments[2], nullptr, 10) : 0);
  const auto seed = static_cast<unsigned>(count > 3 ? std::strtoul(arguments[3], nullptr, 10) : 0);
  const double share = count > 4 ? std::strtod(arguments[4], nullptr) : 0.002;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);  // what was said stands, whatever ends the run
  Tally tally;
  const char* datasets = std::getenv("EIGENPOSE_DATASETS");
  if (datasets != nullptr && *datasets != '\0') {
    const std::size_t real = wanted / 100;
    const bench::SearchWorld world = bench::coil_world(std::filesystem::path(datasets) / "coil-100-half", 40,
                                                       std::max<std::size_t>(real / 3, 1));
    parallel_for(3, threads, [&](std::size_t part) {
      std::mt19937 random(1'000'000 * seed + static_cast<unsigned>(part));
      std::normal_distribution<float> normal(0.0F, 0.003F);
      Comparison comparison(world.manifolds, "real views", tally);
      for (Eigen::VectorXf point : part == 0 ? world.known : part == 1 ? world.perturbed : world.unknown) {
        for (float& x : point) x += normal(random);
        comparison.ask(point, part == 2 ? world.rejection_distance : random_bound(random));
      }
    });
    std::printf("real views done: %zu queries\n", tally.queries.load());
  } else {
    std::printf("EIGENPOSE_DATASETS is not set: no real views among the queries\n");
  }
  const std::size_t left = wanted - std::min(wanted, tally.queries.load());
  const auto of_patches = static_cast<std::size_t>(share * static_cast<double>(left));
  const std::size_t patch_lists = (of_patches + queries_per_patch_list - 1) / queries_per_patch_list;
  const std::size_t lists = (left - of_patches + queries_per_list - 1) / queries_per_list;
  std::atomic<std::size_t> lists_done{0};
  parallel_for(patch_lists + lists, threads, [&](std::size_t i) {
    std::mt19937 random(1'000'000 * seed + static_cast<unsigned>(1000 + i));
    const bool patches = i < patch_lists;
    const std::size_t dofs = !patches ? 1 : i % 20 == 19 ? 4 : i % 5 == 1 ? 3 : 2;
    const auto list = random_list(dofs, random);
    Comparison comparison(list, "seed " + std::to_string(seed) + ", list " + std::to_string(i), tally);
    const std::size_t queries = patches ? queries_per_patch_list : queries_per_list;
    for (std::size_t k = 0; k < queries; ++k)
      comparison.ask(synthetic::random_query(list, random).point, random_bound(random));
    const std::size_t before = lists_done++;
    const std::size_t all = patch_lists + lists;
    if (10 * (before + 1) / all > 10 * before / all)
      std::printf("%zu of %zu lists, %zu queries\n", before + 1, all, tally.queries.load());
  });
  for (std::size_t m = 1; m <= max_manifold_dofs; ++m)
    std::printf("%zu queries about manifolds of %zu DOFs\n", tally.of_dofs[m].load(), m);
  if (tally.missed_by_oracle > 0)
    std::printf("%zu answers are nearer than the oracle's, and lie on the manifold\n",
                tally.missed_by_oracle.load());
  std::size_t wrong = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    std::printf("%-6s %zu queries, %zu different from the oracle, largest difference of distance %.2e\n",
                kinds[k], tally.queries.load(), tally.wrong[k], tally.worst[k]);
    wrong += tally.wrong[k];
  }
  return wrong == 0 ? 0 : 1;
}
