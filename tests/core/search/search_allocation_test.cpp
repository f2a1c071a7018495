// The per-frame path of the search allocates nothing. A program of its own: it replaces operator new.

#include <random>

#include <gtest/gtest.h>

#include "core/search/search.h"
#include "tests/core/search/search_queries.h"
#include "tests/support/counted_memory.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

using testing::allocations;

TEST(TreeSearch, AllocatesNothingAfterTheFirstQuery) {
  std::mt19937 random(51);
  std::vector<Manifold> list;
  for (int i = 0; i < 40; ++i) list.push_back(synthetic::smooth_curve(24, 20, i % 2 == 0 ? 2 : 3, random));
  list.push_back(synthetic::smooth_manifold(
      {synthetic::axis("table", 8, true, false, random), synthetic::axis("x", 4, false, false, random)}, 20,
      2, random, 2));
  std::vector<Eigen::VectorXf> points;
  for (int i = 0; i < 500; ++i) points.push_back(synthetic::random_query(list, random).point);
  const auto search = make_search(list);
  ClosestPoint results[41];
  // Asking for all of them once brings the memory of the thread to its full size.
  ASSERT_EQ(search->nearest_into(points[0], results), 41U);
  const long before = allocations;
  std::size_t found = 0;
  for (const auto& point : points) found += search->nearest_into(point, {results, 2});
  EXPECT_GT(before, 0) << "memory is counted";
  EXPECT_EQ(allocations - before, 0);
  EXPECT_EQ(found, 2 * points.size());
}

}  // namespace
}  // namespace eigenpose
