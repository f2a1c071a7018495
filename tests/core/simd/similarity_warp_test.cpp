#include "core/simd/similarity_warp.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

struct Picture {
  int side;
  test::Unaligned<float> texels;

  Picture(int picture_side, unsigned seed)
      : side(picture_side),
        texels(static_cast<std::size_t>(side) * static_cast<std::size_t>(side) * 4, 1, NAN) {
    std::mt19937 random(seed);
    test::fill_normal(texels, random);
  }
  [[nodiscard]] GradientPicture view() const { return {texels.data(), side}; }

  /// Component of a texel between four, rounded after each operation.
  [[nodiscard]] float at(float x, float y, std::size_t component) const {
    const auto last = static_cast<float>(side - 1);
    x = std::clamp(x, 0.0F, last);
    y = std::clamp(y, 0.0F, last);
    const int column = std::min(static_cast<int>(x), side - 2);
    const int row = std::min(static_cast<int>(y), side - 2);
    const float across = x - static_cast<float>(column);
    const float down = y - static_cast<float>(row);
    const auto texel = [&](int r, int c) {
      return texels[static_cast<std::size_t>(4 * (r * side + c)) + component];
    };
    const float top_step = across * (texel(row, column + 1) - texel(row, column));
    const float top = texel(row, column) + top_step;
    const float bottom_step = across * (texel(row + 1, column + 1) - texel(row + 1, column));
    const float bottom = texel(row + 1, column) + bottom_step;
    const float step = down * (bottom - top);
    return top + step;
  }
};

struct Warped {
  test::Unaligned<float> values;
  test::Unaligned<float> by_x;
  test::Unaligned<float> by_y;
  test::Unaligned<float> by_scale;
  test::Unaligned<float> by_rotation;

  explicit Warped(int side)
      : values(pixels(side), 1, 9.0F),
        by_x(pixels(side), 2, 9.0F),
        by_y(pixels(side), 3, 9.0F),
        by_scale(pixels(side), 1, 9.0F),
        by_rotation(pixels(side), 1, 9.0F) {}
  static std::size_t pixels(int side) {
    return static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
  }
};

Warped plain_warp(const Picture& picture, const SimilaritySampling& s) {
  Warped out(s.side);
  std::size_t i = 0;
  for (int row = 0; row < s.side; ++row) {
    for (int column = 0; column < s.side; ++column, ++i) {
      const float across = (static_cast<float>(column) + 0.5F) * s.step;
      const float along = (static_cast<float>(row) + 0.5F) * s.step;
      const float u = across - s.middle;
      const float v = along - s.middle;
      const float cosine_u = s.cosine * u;
      const float sine_v = s.sine * v;
      const float sine_u = s.sine * u;
      const float cosine_v = s.cosine * v;
      const float dx = cosine_u - sine_v;
      const float dy = sine_u + cosine_v;
      const float gx = picture.at(s.x + dx, s.y + dy, 1);
      const float gy = picture.at(s.x + dx, s.y + dy, 2);
      out.values[i] = picture.at(s.x + dx, s.y + dy, 0);
      out.by_x[i] = gx;
      out.by_y[i] = gy;
      const float scale_x = gx * dx;
      const float scale_y = gy * dy;
      out.by_scale[i] = scale_x + scale_y;
      const float rotation_y = gy * dx;
      const float rotation_x = gx * dy;
      out.by_rotation[i] = rotation_y - rotation_x;
    }
  }
  return out;
}

void expect_same(const test::Unaligned<float>& found, const test::Unaligned<float>& expected,
                 const char* what) {
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_EQ(found[i], expected[i]) << what << " of pixel " << i;
  EXPECT_TRUE(found.surroundings_are(9.0F)) << what;
}

void expect_plain_warp(const Picture& picture, const SimilaritySampling& sampling) {
  const Warped expected = plain_warp(picture, sampling);
  test::on_every_target([&] {
    Warped found(sampling.side);
    sample_similarity(
        picture.view(), sampling, found.values.data(),
        {found.by_x.data(), found.by_y.data(), found.by_scale.data(), found.by_rotation.data()});
    expect_same(found.values, expected.values, "value");
    expect_same(found.by_x, expected.by_x, "derivative by x");
    expect_same(found.by_y, expected.by_y, "derivative by y");
    expect_same(found.by_scale, expected.by_scale, "derivative by scale");
    expect_same(found.by_rotation, expected.by_rotation, "derivative by rotation");
    Warped alone(sampling.side);
    sample_similarity(picture.view(), sampling, alone.values.data());
    expect_same(alone.values, expected.values, "value alone");
  });
}

// Bits, not tolerances: no operation is fused, on no target.
TEST(SimilarityWarp, IsBilinearInEveryBitAtAnySide) {
  const Picture picture(64, 1);
  for (const int side : {0, 1, 2, 3, 4, 5, 7, 8, 9, 32, 48}) {
    const float step = side == 0 ? 1.0F : 64.0F / static_cast<float>(side);
    expect_plain_warp(picture, {side, step, 32.0F, 31.5F, 31.5F, 1.0F, 0.0F});
    expect_plain_warp(picture,
                      {side, step, 32.0F, 33.1F, 28.7F, 1.04F * std::cos(0.1F), 1.04F * std::sin(0.1F)});
  }
}

TEST(SimilarityWarp, GoesOnAsThePictureEnds) {
  for (const int side : {2, 3, 64}) {
    const Picture picture(side, 2);
    const float middle = 0.5F * static_cast<float>(side);
    expect_plain_warp(picture, {9, 3.0F, middle, -500.0F, 0.0F, 1.0F, 0.5F});
    expect_plain_warp(picture, {9, 3.0F, middle, 700.0F, 900.0F, 2.0F, -3.0F});
    expect_plain_warp(
        picture, {9, 3.0F, middle, static_cast<float>(side - 1), static_cast<float>(side - 1), 0.0F, 0.0F});
  }
}

TEST(SimilarityWarp, ReadsNothingOutsideThePictureWhateverThePosition) {
  const Picture picture(5, 3);  // its surroundings are not numbers
  for (const float x : {1e30F, -1e30F, std::numeric_limits<float>::infinity(),
                        -std::numeric_limits<float>::infinity(), NAN}) {
    test::on_every_target([&] {
      Warped found(7);
      sample_similarity(picture.view(), {7, 1.0F, 3.5F, x, x, 1.0F, 0.0F}, found.values.data());
      EXPECT_TRUE(found.values.surroundings_are(9.0F));
      if (std::isnan(x)) return;  // what it samples is not stated
      for (std::size_t i = 0; i < found.values.size(); ++i)
        EXPECT_EQ(found.values[i], picture.at(x, x, 0)) << x;
    });
  }
}

TEST(SimilarityWarp, OfALinearPictureIsLinearWithTheDerivativesOfItsSlope) {
  Picture picture(16, 4);
  for (int r = 0; r < 16; ++r)
    for (int c = 0; c < 16; ++c) {
      float* texel = picture.texels.data() + std::ptrdiff_t{4} * (r * 16 + c);
      texel[0] = 2.0F * static_cast<float>(c) - 3.0F * static_cast<float>(r);
      texel[1] = 2.0F;
      texel[2] = -3.0F;
    }
  test::on_every_target([&] {
    Warped found(4);
    // Half a turn, half the size, about the middle: pixel (c, r) is at 7.5 − ½(c − 1.5), 7.5 − ½(r − 1.5).
    sample_similarity(
        picture.view(), {4, 1.0F, 2.0F, 7.5F, 7.5F, -0.5F, 0.0F}, found.values.data(),
        {found.by_x.data(), found.by_y.data(), found.by_scale.data(), found.by_rotation.data()});
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) {
        const auto i = static_cast<std::size_t>(4 * r + c);
        const float dx = -0.5F * (static_cast<float>(c) - 1.5F);
        const float dy = -0.5F * (static_cast<float>(r) - 1.5F);
        EXPECT_EQ(found.values[i], 2.0F * (7.5F + dx) - 3.0F * (7.5F + dy));
        EXPECT_EQ(found.by_x[i], 2.0F);
        EXPECT_EQ(found.by_y[i], -3.0F);
        EXPECT_EQ(found.by_scale[i], 2.0F * dx - 3.0F * dy);
        EXPECT_EQ(found.by_rotation[i], -3.0F * dx - 2.0F * dy);
      }
    }
  });
}

}  // namespace
}  // namespace eigenpose
