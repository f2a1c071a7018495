#include "core/search/bernstein.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace eigenpose::bernstein {
namespace {

/// Bernstein polynomials by their definition.
double value_of(const Shape& shape, const std::vector<double>& b, const std::array<double, max_axes>& u) {
  double sum = 0.0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    double weight = 1.0;
    for (int a = 0; a < shape.axes; ++a) {
      const int n = shape.degree[a];
      const int k = static_cast<int>(i / shape.stride(a)) % (n + 1);
      weight *= binomial(n, k) * std::pow(u[a], k) * std::pow(1.0 - u[a], n - k);
    }
    sum += weight * b[i];
  }
  return sum;
}

std::vector<double> random_coefficients(const Shape& shape, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<double> b(shape.size());
  for (double& x : b) x = unit(random);
  return b;
}

/// Calls `visit` with every point of a grid of 0…1.
template <typename Visit>
void for_grid(int axes, int steps, const Visit& visit) {
  std::array<double, max_axes> u{};
  const auto total = static_cast<int>(std::pow(steps + 1, axes) + 0.5);
  for (int i = 0; i < total; ++i) {
    int rest = i;
    for (int a = 0; a < axes; ++a) {
      u[a] = static_cast<double>(rest % (steps + 1)) / steps;
      rest /= steps + 1;
    }
    visit(u);
  }
}

const Shape shapes[] = {{1, {4}}, {1, {6}}, {2, {4, 4}}, {2, {2, 6}}, {3, {2, 4, 2}}};

TEST(Bernstein, SplitsIntoHalvesOfTheSamePolynomial) {
  std::mt19937 random(1);
  for (const Shape& shape : shapes)
    for (int axis = 0; axis < shape.axes; ++axis) {
      const auto b = random_coefficients(shape, random);
      std::vector<double> low(b.size());
      std::vector<double> high(b.size());
      split(shape, axis, b.data(), low.data(), high.data());
      for_grid(shape.axes, 4, [&](std::array<double, max_axes> u) {
        auto whole = u;
        whole[axis] = 0.5 * u[axis];
        EXPECT_NEAR(value_of(shape, low, u), value_of(shape, b, whole), 1e-12);
        whole[axis] = 0.5 + 0.5 * u[axis];
        EXPECT_NEAR(value_of(shape, high, u), value_of(shape, b, whole), 1e-12);
      });
    }
}

TEST(Bernstein, BoundsEveryValueAndMoreTightlyTheMoreItHalves) {
  std::mt19937 random(2);
  for (const Shape& shape : shapes) {
    const auto b = random_coefficients(shape, random);
    double lowest = 1e9;
    double highest = -1e9;
    for_grid(shape.axes, 20, [&](const auto& u) {
      lowest = std::min(lowest, value_of(shape, b, u));
      highest = std::max(highest, value_of(shape, b, u));
    });
    double before = 1e9;
    for (const int levels : {0, 1, 3}) {
      const Range bounds = range(shape, b, levels);
      EXPECT_LE(bounds.low, lowest + 1e-12);
      EXPECT_GE(bounds.high, highest - 1e-12);
      EXPECT_LE(bounds.high - bounds.low, before);
      before = bounds.high - bounds.low;
    }
    EXPECT_LT(before, highest - lowest + 0.25);
  }
}

TEST(Bernstein, FindsTheGlobalMinimumOfACurve) {
  std::mt19937 random(3);
  for (int i = 0; i < 500; ++i) {
    const Shape shape{1, {i % 2 == 0 ? 4 : 6}};
    const auto b = random_coefficients(shape, random);
    double lowest = 1e9;
    for_grid(1, 2000, [&](const auto& u) { lowest = std::min(lowest, value_of(shape, b, u)); });
    const Minimum found = minimize_curve(shape.degree[0], b.data(), 10.0, 1e-15);
    ASSERT_TRUE(found.found);
    EXPECT_LE(found.value, lowest + 1e-12);
    EXPECT_GE(found.value, lowest - 1e-5) << "a grid of 2000 misses the minimum by less";
    EXPECT_NEAR(value_of(shape, b, found.u), found.value, 1e-12) << "the value is that of the place";
    EXPECT_FALSE(minimize_curve(shape.degree[0], b.data(), found.value - 1e-6, 1e-15).found);
    EXPECT_TRUE(minimize_curve(shape.degree[0], b.data(), found.value + 1e-6, 1e-15).found);
  }
}

TEST(Bernstein, FindsTheGlobalMinimumOverSeveralAxes) {
  std::mt19937 random(4);
  MinimizeScratch scratch;
  for (const Shape& shape : shapes) {
    if (shape.axes < 2) continue;
    for (int i = 0; i < 40; ++i) {
      const auto b = random_coefficients(shape, random);
      double lowest = 1e9;
      for_grid(shape.axes, shape.axes == 2 ? 100 : 25,
               [&](const auto& u) { lowest = std::min(lowest, value_of(shape, b, u)); });
      const Minimum found = minimize(shape, b.data(), 10.0, {1e-15, 1e-7}, {}, scratch);
      ASSERT_TRUE(found.found);
      EXPECT_LE(found.value, lowest + 1e-6);
      EXPECT_NEAR(value_of(shape, b, found.u), found.value, 1e-9);
      for (int a = 0; a < shape.axes; ++a) EXPECT_TRUE(found.u[a] >= 0.0 && found.u[a] <= 1.0);
      EXPECT_FALSE(minimize(shape, b.data(), 0.9 * found.value, {1e-15, 1e-7}, {}, scratch).found);
    }
  }
}

TEST(Bernstein, LeavesTheMinimumOfAJoinedFaceToTheNeighbour) {
  // Rises along the first axis everywhere: the minimum stands on u₀ = 0.
  const Shape shape{2, {2, 2}};
  std::vector<double> b;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) b.push_back(0.2 + 0.3 * i + 0.1 * k * k);
  MinimizeScratch scratch;
  const Minimum alone = minimize(shape, b.data(), 10.0, {1e-15, 1e-7}, {}, scratch);
  ASSERT_TRUE(alone.found);
  EXPECT_NEAR(alone.value, 0.2, 1e-9);
  EXPECT_EQ(alone.u[0], 0.0);
  Joints high;
  high.high[0] = true;
  EXPECT_NEAR(minimize(shape, b.data(), 10.0, {1e-15, 1e-7}, high, scratch).value, 0.2, 1e-9)
      << "a neighbour on the other side changes nothing";
}

}  // namespace
}  // namespace eigenpose::bernstein
