#include "core/base/statistics.h"

#include <functional>
#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Statistics, FindsEveryOrderStatistic) {
  const std::vector<int> shuffled{5, 1, 4, 1, 9, 2, 6};
  const std::vector<int> ascending{1, 1, 2, 4, 5, 6, 9};
  for (std::size_t k = 0; k < shuffled.size(); ++k) {
    std::vector<int> values = shuffled;
    EXPECT_EQ(order_statistic(values, k), ascending[k]);
    values = shuffled;
    EXPECT_EQ(order_statistic(values, k, std::greater<>()), ascending[ascending.size() - 1 - k]);
  }
}

TEST(Statistics, TakesTheUpperOfTwoMiddleValues) {
  EXPECT_EQ(upper_median(std::vector<double>{3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(upper_median(std::vector<double>{4.0, 1.0, 3.0, 2.0}), 3.0);
  EXPECT_EQ(upper_median(std::vector<double>{7.0}), 7.0);
}

TEST(Statistics, RoundsQuantilesUp) {
  std::vector<double> values;
  for (int i = 100; i >= 0; --i) values.push_back(i);
  EXPECT_EQ(quantile(values, 0.0), 0.0);
  EXPECT_EQ(quantile(values, 0.99), 99.0);
  EXPECT_EQ(quantile(values, 0.991), 100.0);
  EXPECT_EQ(quantile(values, 1.0), 100.0);
}

TEST(Statistics, KnowsMeanAndRootMeanSquare) {
  EXPECT_DOUBLE_EQ(mean(std::vector<double>{1.0, 2.0, 6.0}), 3.0);
  EXPECT_DOUBLE_EQ(root_mean_square(std::vector<float>{3.0F, -4.0F, 0.0F, 0.0F}), 2.5);
  EXPECT_EQ(mean(std::vector<double>()), 0.0);
  EXPECT_EQ(root_mean_square(std::vector<double>()), 0.0);
}

}  // namespace
}  // namespace eigenpose
