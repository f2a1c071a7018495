#include "core/simd/pixel_arithmetic.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

TEST(PixelArithmetic, AddsWhatIsAboveTheLevels) {
  std::mt19937 random(1);
  std::array<std::uint8_t, level_block> levels;
  test::fill_bytes(levels, random);
  levels[0] = 0;
  levels[1] = 255;
  for (const std::size_t count : test::lengths) {
    test::Unaligned<std::uint8_t> bytes(count, 1);
    test::Unaligned<float> before(count, 3);
    test::fill_bytes(bytes, random);
    for (std::size_t i = 0; i < count; i += 5) bytes[i] = 255;
    test::fill_normal(before, random);
    test::on_every_target([&] {
      test::Unaligned<float> out(count, 1, 9.0F);
      std::copy_n(before.data(), count, out.data());
      add_above_levels(bytes.data(), count, levels.data(), 0.7F, out.data());
      for (std::size_t i = 0; i < count; ++i) {
        const double added = 0.7F * std::max(0.0, static_cast<double>(bytes[i]) - levels[i % level_block]);
        const double larger = std::max(added, std::fabs(static_cast<double>(before[i])));
        ASSERT_NEAR(out[i], before[i] + added, 0x1p-23 * larger) << count << ' ' << i;
      }
      EXPECT_TRUE(out.surroundings_are(9.0F));
    });
  }
}

TEST(PixelArithmetic, AddsExactlyWhereTheWeightIsAPowerOfTwo) {
  std::array<std::uint8_t, level_block> levels;
  for (std::size_t i = 0; i < level_block; ++i) levels[i] = static_cast<std::uint8_t>(i);
  for (int byte = 0; byte < 256; ++byte) {
    const std::vector<std::uint8_t> bytes(2 * level_block + 7, static_cast<std::uint8_t>(byte));
    test::on_every_target([&] {
      std::vector<float> out(bytes.size(), 1.0F);
      add_above_levels(bytes.data(), bytes.size(), levels.data(), 0.5F, out.data());
      for (std::size_t i = 0; i < out.size(); ++i)
        ASSERT_EQ(out[i], 1.0F + 0.5F * static_cast<float>(std::max(0, byte - levels[i % level_block])))
            << byte << ' ' << i;
    });
  }
}

TEST(PixelArithmetic, SumsSquares) {
  std::mt19937 random(2);
  std::vector<std::size_t> counts = test::lengths;
  counts.push_back(100000);
  for (const std::size_t count : counts) {
    test::Unaligned<float> in(count, 1, NAN);
    test::fill_normal(in, random);
    double expected = 0.0;
    for (std::size_t i = 0; i < count; ++i) expected += static_cast<double>(in[i]) * in[i];
    test::on_every_target([&] {
      const float found = sum_of_squares(in.data(), count);
      EXPECT_NEAR(found, expected, static_cast<double>(count) * 0x1p-24 * expected) << count;
      EXPECT_EQ(found, sum_of_squares(in.data(), count)) << "the same bits each time";
    });
  }
}

TEST(PixelArithmetic, TurnsColoursToOpponentAxes) {
  std::mt19937 random(5);
  for (const std::size_t count : test::lengths) {
    test::Unaligned<float> in(3 * count, 1);
    test::fill_normal(in, random);
    test::on_every_target([&] {
      test::Unaligned<float> out(3 * count, 1, 9.0F);
      to_opponent_axes(in.data(), count, 3.0F, out.data());
      for (std::size_t i = 0; i < count; ++i) {
        const double b = in[3 * i], g = in[3 * i + 1], r = in[3 * i + 2];
        const double error = 3.0 * 0x1p-22 * (std::fabs(b) + std::fabs(g) + std::fabs(r));
        ASSERT_NEAR(out[3 * i], (b + g + r) / std::sqrt(3.0), error) << count << ' ' << i;
        ASSERT_NEAR(out[3 * i + 1], 3.0 * (r - g) / std::sqrt(2.0), error) << count << ' ' << i;
        ASSERT_NEAR(out[3 * i + 2], 3.0 * (2.0 * b - r - g) / std::sqrt(6.0), error) << count << ' ' << i;
      }
      EXPECT_TRUE(out.surroundings_are(9.0F));
    });
  }
}

TEST(PixelArithmetic, FindsTheLargestWhereverItStands) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> value(0.0F, 1.0F);
  for (const std::size_t count : test::lengths) {
    test::Unaligned<float> in(count, 1, 1e30F);
    for (std::size_t at = 0; at < count; at += 1 + count / 40) {
      for (std::size_t i = 0; i < count; ++i) in[i] = value(random);
      in[at] = 1.5F;
      test::on_every_target([&] { ASSERT_EQ(largest_of(in.data(), count), 1.5F) << count << ' ' << at; });
    }
  }
  test::on_every_target([] { EXPECT_EQ(largest_of(nullptr, 0), 0.0F); });
}

TEST(PixelArithmetic, RoundsScaledValuesToTheSameBytesEverywhere) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> value(0.0F, 1.0F);
  for (const std::size_t count : test::lengths) {
    test::Unaligned<float> in(count, 1, 0.5F);
    for (std::size_t i = 0; i < count; ++i) in[i] = value(random);
    if (count > 2) in[count - 1] = 1.0F;
    const float gain = 254.9F;
    test::on_every_target([&] {
      test::Unaligned<std::uint8_t> bytes(count, 1, 99);
      round_scaled(in.data(), gain, count, bytes.data());
      for (std::size_t i = 0; i < count; ++i) {
        const float product = in[i] * gain;
        const float sum = product + 0.5F;
        ASSERT_EQ(bytes[i], static_cast<std::uint8_t>(sum)) << count << ' ' << i;
      }
      EXPECT_TRUE(bytes.surroundings_are(99));
    });
  }
}

TEST(PixelArithmetic, RoundsHalvesUpAndStopsAt255) {
  const std::vector<std::pair<float, int>> cases = {
      {0.0F, 0},     {0.49F, 0},    {0.5F, 1},     {1.5F, 2},     {2.5F, 3},
      {254.4F, 254}, {254.5F, 255}, {255.4F, 255}, {256.0F, 255}, {70000.0F, 255}};
  for (const auto& [value, expected] : cases) {
    const std::vector<float> in(19, value);  // in whole vectors and after them
    test::on_every_target([&] {
      std::vector<std::uint8_t> bytes(in.size());
      round_scaled(in.data(), 1.0F, in.size(), bytes.data());
      for (const std::uint8_t byte : bytes) ASSERT_EQ(byte, expected) << value;
    });
  }
}

}  // namespace
}  // namespace eigenpose
