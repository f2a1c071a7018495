#include "core/base/grid.h"

#include <array>
#include <set>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Grid, NumbersItsPointsWithTheLastAxisFastest) {
  const Grid grid({3, 4, 5});
  EXPECT_EQ(grid.size(), 60U);
  std::size_t flat = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 4; ++b)
      for (std::size_t c = 0; c < 5; ++c, ++flat) {
        EXPECT_EQ(grid.flat(std::array<std::size_t, 3>{a, b, c}), flat);
        EXPECT_EQ(grid.index(flat, 0), a);
        EXPECT_EQ(grid.index(flat, 1), b);
        EXPECT_EQ(grid.index(flat, 2), c);
      }
}

TEST(Grid, WithoutAxesHasOnePoint) {
  EXPECT_EQ(Grid().size(), 1U);
  EXPECT_EQ(Grid().axes(), 0U);
}

TEST(Grid, GoesRoundTheSeamOfAClosedAxis) {
  const Grid grid({3, 4});
  const std::size_t last = grid.flat(std::array<std::size_t, 2>{1, 3});
  EXPECT_EQ(grid.neighbour(last, 1, 1, Grid::Ends::closed), grid.flat(std::array<std::size_t, 2>{1, 0}));
  EXPECT_EQ(grid.neighbour(grid.flat(std::array<std::size_t, 2>{0, 2}), 0, -1, Grid::Ends::closed),
            grid.flat(std::array<std::size_t, 2>{2, 2}));
  // Several times round, either way.
  for (std::ptrdiff_t steps = -9; steps <= 9; ++steps)
    EXPECT_EQ(grid.index(*grid.neighbour(last, 1, steps, Grid::Ends::closed), 1),
              static_cast<std::size_t>(((3 + steps) % 4 + 4) % 4));
}

TEST(Grid, HasNothingBeyondTheEndOfAnOpenAxis) {
  const Grid grid({3, 4});
  for (std::size_t flat = 0; flat < grid.size(); ++flat)
    for (std::size_t axis = 0; axis < 2; ++axis)
      for (const std::ptrdiff_t steps : {-1, 1}) {
        const auto there = static_cast<std::ptrdiff_t>(grid.index(flat, axis)) + steps;
        const bool inside = there >= 0 && there < static_cast<std::ptrdiff_t>(grid.count(axis));
        const auto found = grid.neighbour(flat, axis, steps, Grid::Ends::open);
        ASSERT_EQ(found.has_value(), inside);
        if (found) {
          EXPECT_EQ(grid.index(*found, axis), static_cast<std::size_t>(there));
          EXPECT_EQ(grid.index(*found, 1 - axis), grid.index(flat, 1 - axis));
        }
      }
}

}  // namespace
}  // namespace eigenpose
