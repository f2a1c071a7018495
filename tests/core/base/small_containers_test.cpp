#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/bounded_vector.h"
#include "core/base/insertion_sort.h"

namespace eigenpose {
namespace {

TEST(BoundedVector, GrowsWithEmptyElementsAndComparesByContent) {
  BoundedVector<double, 4> a;
  EXPECT_TRUE(a.empty());
  a.push_back(1.0);
  a.resize(3);
  EXPECT_EQ(std::vector<double>(a.begin(), a.end()), (std::vector<double>{1.0, 0.0, 0.0}));
  a[1] = 5.0;
  a.resize(1);
  a.resize(2);
  EXPECT_EQ(a[1], 0.0) << "what was cut off does not come back";
  BoundedVector<double, 4> b;
  b.push_back(1.0);
  EXPECT_FALSE(a == b);
  b.push_back(0.0);
  EXPECT_TRUE(a == b);
  EXPECT_EQ(std::span<const double>(a).size(), 2U);
}

TEST(InsertionSort, KeepsTheOrderOfEqualElements) {
  std::vector<std::pair<int, int>> elements{{2, 0}, {1, 1}, {2, 2}, {0, 3}, {1, 4}};
  insertion_sort(elements, [](const auto& a, const auto& b) { return a.first < b.first; });
  EXPECT_EQ(elements, (std::vector<std::pair<int, int>>{{0, 3}, {1, 1}, {1, 4}, {2, 0}, {2, 2}}));
}

}  // namespace
}  // namespace eigenpose
