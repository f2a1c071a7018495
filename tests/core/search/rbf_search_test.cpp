#include "core/search/rbf_search.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "tests/core/search/search_queries.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

std::vector<Manifold> five_curves() {
  std::mt19937 random(44);
  std::vector<Manifold> list;
  list.reserve(5);
  for (int i = 0; i < 5; ++i)
    list.push_back(
        synthetic::smooth_manifold({synthetic::axis("table", 18, true, false, random)}, 8, 2, random, 3));
  return list;
}

TEST(RbfSearch, NamesObjectsInTheOrderOfTheNetworkAndNoneWhereItsFirstIsBeyondTheBound) {
  const std::vector<Manifold> list = five_curves();
  const RbfSearch search(list);
  const RbfRecognizer networks(list);
  std::mt19937 random(7);
  constexpr double unbounded = std::numeric_limits<double>::infinity();
  int first_beyond = 0;
  int skipped = 0;
  for (int i = 0; i < 60; ++i) {
    const Eigen::VectorXf point = synthetic::random_query(list, random).point;
    const Eigen::VectorXd exact = point.cast<double>();
    const Eigen::VectorXd scores = networks.scores(exact);
    std::vector<std::size_t> order(list.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
      return scores[static_cast<Eigen::Index>(a)] > scores[static_cast<Eigen::Index>(b)];
    });
    std::vector<double> distances;
    distances.reserve(order.size());
    for (const std::size_t o : order)
      distances.push_back((exact - list[o].evaluate(networks.pose(o, exact))).norm());
    for (const double bound : {unbounded, 1.001 * distances[0], 0.999 * distances[0], 0.999 * distances[1]})
      for (const std::size_t count : {std::size_t{1}, std::size_t{2}, list.size()}) {
        std::vector<Closest> expected;
        for (std::size_t k = 0; k < order.size() && distances[0] <= bound && expected.size() < count; ++k)
          if (distances[k] <= bound)
            expected.push_back({order[k], networks.pose(order[k], exact), distances[k]});
        const auto found = search.nearest(point, count, bound);
        ASSERT_EQ(found.size(), expected.size()) << i;
        for (std::size_t k = 0; k < found.size(); ++k) {
          EXPECT_EQ(found[k].manifold, expected[k].manifold);
          EXPECT_EQ(found[k].q, expected[k].q);
          EXPECT_EQ(found[k].distance, expected[k].distance);
        }
        first_beyond += distances[0] > bound && *std::ranges::min_element(distances) <= bound ? 1 : 0;
        skipped += found.size() >= 2 && found[1].manifold != order[1] ? 1 : 0;
      }
  }
  EXPECT_GT(first_beyond, 0) << "or the rule is not seen";
  EXPECT_GT(skipped, 0);
}

}  // namespace
}  // namespace eigenpose
