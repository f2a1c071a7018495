#include "core/alignment/misalignment.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace eigenpose {
namespace {

constexpr int pixels_a_side = 8;

std::vector<float> random_picture(int bands) {
  SeededRandom random(3);
  std::vector<float> picture(static_cast<std::size_t>(pixels_a_side * pixels_a_side * bands));
  for (float& value : picture) value = static_cast<float>(random.unit());
  return picture;
}

/// Calls `expected(row, column)` for the place in `picture` that each pixel of the result shows.
template <typename Place>
void expect_places(const Misalignment& misalignment, const Place& expected) {
  for (const int bands : {1, 3}) {
    const std::vector<float> picture = random_picture(bands);
    std::vector<float> out(picture.size());
    const float norm = undo_misalignment(picture, pixels_a_side, bands, misalignment, out);
    double squares = 0.0;
    for (int r = 0; r < pixels_a_side; ++r)
      for (int c = 0; c < pixels_a_side; ++c) {
        const auto [row, column] = expected(r, c);
        for (int b = 0; b < bands; ++b) {
          const float value = out[static_cast<std::size_t>((r * pixels_a_side + c) * bands + b)];
          EXPECT_NEAR(value, picture[static_cast<std::size_t>((row * pixels_a_side + column) * bands + b)],
                      1e-5F)
              << r << ", " << c << " of " << bands << " bands";
          squares += static_cast<double>(value) * static_cast<double>(value);
        }
      }
    EXPECT_NEAR(norm, std::sqrt(squares), 1e-4);
  }
}

TEST(UndoMisalignment, OfNothingIsThePicture) {
  expect_places({}, [](int r, int c) { return std::pair(r, c); });
}

TEST(UndoMisalignment, ShowsWhatStandsAsideAndRepeatsTheBorder) {
  expect_places({.dx = 1.0 / pixels_a_side, .dy = -2.0 / pixels_a_side}, [](int r, int c) {
    return std::pair(std::max(r - 2, 0), std::min(c + 1, pixels_a_side - 1));
  });
}

TEST(UndoMisalignment, TurnsAboutTheMiddle) {
  // A quarter turn either way, x to the right and y down.
  expect_places({.rotation = 0.5 * std::numbers::pi},
                [](int r, int c) { return std::pair(c, pixels_a_side - 1 - r); });
  expect_places({.rotation = -0.5 * std::numbers::pi},
                [](int r, int c) { return std::pair(pixels_a_side - 1 - c, r); });
  expect_places({.rotation = std::numbers::pi},
                [](int r, int c) { return std::pair(pixels_a_side - 1 - r, pixels_a_side - 1 - c); });
}

TEST(UndoMisalignment, EnlargesAboutTheMiddle) {
  // Three times as far from the middle: pixel 3 shows pixel 2, pixel 4 pixel 5, all beyond the border.
  const auto far = [](int i) { return i < 3 ? 0 : i == 3 ? 2 : i == 4 ? 5 : pixels_a_side - 1; };
  expect_places({.scale = 2.0}, [&](int r, int c) { return std::pair(far(r), far(c)); });
}

TEST(UndoMisalignment, InterpolatesBetweenPixels) {
  const std::vector<float> picture = random_picture(1);
  std::vector<float> out(picture.size());
  (void)undo_misalignment(picture, pixels_a_side, 1, {.dx = 0.25 / pixels_a_side}, out);
  EXPECT_NEAR(out[9], 0.75F * picture[9] + 0.25F * picture[10], 1e-5F);
}

}  // namespace
}  // namespace eigenpose
