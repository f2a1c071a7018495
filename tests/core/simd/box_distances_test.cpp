#include "core/simd/box_distances.h"

#include <algorithm>
#include <limits>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

struct Expected {
  std::uint32_t mask = 0;
  float squared[box_lanes];
  float order[box_lanes];
};

/// All dimensions, one box after the other.
Expected plain_distances(const std::vector<BoxSlice>& slices, const std::vector<float>& point, float bound) {
  Expected result;
  for (std::size_t lane = 0; lane < box_lanes; ++lane) {
    float squared = 0.0F;
    float centre = 0.0F;
    for (std::size_t k = 0; k < slices.size(); ++k) {
      const float below = slices[k].low[lane] - point[k];
      const float above = point[k] - slices[k].high[lane];
      const float outside = std::max(0.0F, std::max(below, above));
      squared += outside * outside;
      centre += (below - above) * (below - above);
    }
    result.squared[lane] = squared;
    result.order[lane] = squared + 0.005F * centre;
    if (squared <= bound) result.mask |= 1U << lane;
  }
  return result;
}

std::vector<BoxSlice> random_boxes(std::size_t dimensions, std::mt19937& random) {
  std::normal_distribution<float> normal;
  std::vector<BoxSlice> slices(dimensions);
  for (BoxSlice& slice : slices) {
    for (std::size_t lane = 0; lane < box_lanes; ++lane) {
      const float a = normal(random);
      const float b = normal(random);
      slice.low[lane] = std::min(a, b);
      slice.high[lane] = std::max(a, b);
    }
  }
  return slices;
}

// Bits, not tolerances: no operation is fused, on no target.
TEST(BoxDistances, AreThePlainOnesInEveryBit) {
  std::mt19937 random(1);
  for (const std::size_t dimensions : {1U, 2U, 3U, 4U, 5U, 8U, 11U, 35U}) {
    const auto slices = random_boxes(dimensions, random);
    std::vector<float> point(dimensions);
    test::fill_normal(point, random);
    const float all = std::numeric_limits<float>::infinity();
    const Expected expected = plain_distances(slices, point, all);
    test::on_every_target([&] {
      BoxDistances found;
      EXPECT_EQ(box_distances(slices.data(), point.data(), dimensions, all, found), 0xFFFFU);
      for (std::size_t lane = 0; lane < box_lanes; ++lane)
        EXPECT_EQ(found.squared[lane], expected.squared[lane]) << dimensions << " dimensions, box " << lane;
      BoxDistances ordered;
      EXPECT_EQ(ordered_box_distances(slices.data(), point.data(), dimensions, all, ordered), 0xFFFFU);
      for (std::size_t lane = 0; lane < box_lanes; ++lane) {
        EXPECT_EQ(ordered.squared[lane], expected.squared[lane]);
        EXPECT_EQ(ordered.order[lane], expected.order[lane]);
      }
    });
  }
}

TEST(BoxDistances, MarkTheBoxesWithinTheBoundEachAlone) {
  std::mt19937 random(2);
  const auto slices = random_boxes(6, random);
  std::vector<float> point(6);
  test::fill_normal(point, random);
  const Expected all = plain_distances(slices, point, 0.0F);
  for (std::size_t box = 0; box < box_lanes; ++box) {
    // The bound itself belongs to it.
    const float bound = all.squared[box];
    const std::uint32_t expected = plain_distances(slices, point, bound).mask;
    test::on_every_target([&] {
      BoxDistances found;
      EXPECT_EQ(box_distances(slices.data(), point.data(), 6, bound, found), expected) << box;
      EXPECT_EQ(ordered_box_distances(slices.data(), point.data(), 6, bound, found), expected) << box;
    });
  }
}

TEST(BoxDistances, AreLowerBoundsWhereNoBoxIsWithinTheBound) {
  std::mt19937 random(3);
  const auto slices = random_boxes(35, random);
  const std::vector<float> point(35, 5.0F);
  const Expected all = plain_distances(slices, point, 1.0F);
  ASSERT_EQ(all.mask, 0U);
  test::on_every_target([&] {
    BoxDistances found;
    EXPECT_EQ(box_distances(slices.data(), point.data(), 35, 1.0F, found), 0U);
    for (std::size_t lane = 0; lane < box_lanes; ++lane) {
      EXPECT_GT(found.squared[lane], 1.0F);
      EXPECT_LE(found.squared[lane], all.squared[lane]);
      EXPECT_LT(found.squared[lane], 0.5F * all.squared[lane]) << "later dimensions are left out";
    }
  });
}

TEST(BoxDistances, AreZeroWithoutDimensions) {
  test::on_every_target([] {
    BoxDistances found;
    EXPECT_EQ(box_distances(nullptr, nullptr, 0, 0.0F, found), 0xFFFFU);
    for (const float squared : found.squared) EXPECT_EQ(squared, 0.0F);
    EXPECT_EQ(box_distances(nullptr, nullptr, 0, -1.0F, found), 0U);
  });
}

TEST(BoxDistances, AreInfiniteToBoxesAtInfinity) {
  std::vector<BoxSlice> slices(1);
  std::fill_n(slices[0].low, box_lanes, std::numeric_limits<float>::infinity());
  std::fill_n(slices[0].high, box_lanes, std::numeric_limits<float>::infinity());
  const float point = -std::numeric_limits<float>::max();
  test::on_every_target([&] {
    BoxDistances found;
    EXPECT_EQ(box_distances(slices.data(), &point, 1, std::numeric_limits<float>::max(), found), 0U);
    for (const float squared : found.squared) EXPECT_EQ(squared, std::numeric_limits<float>::infinity());
  });
}

}  // namespace
}  // namespace eigenpose
