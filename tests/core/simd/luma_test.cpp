#include "core/simd/luma.h"

#include <algorithm>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

/// As the header defines it.
std::uint8_t spread(int y) {
  return static_cast<std::uint8_t>(std::min((std::max(0, y - 16) * 596 / 256 + 1) / 2, 255));
}

TEST(Luma, SpreadsEveryByteAtEveryLength) {
  for (int y = 0; y < 256; ++y) {
    const double exact = std::clamp((y - 16) * 255.0 / 219.0, 0.0, 255.0);
    EXPECT_NEAR(spread(y), exact, 0.57) << y;
  }
  std::mt19937 random(1);
  std::vector<std::size_t> counts = test::lengths;
  counts.push_back(256);
  for (const std::size_t count : counts) {
    test::Unaligned<std::uint8_t> source(count, 1);
    for (std::size_t i = 0; i < count; ++i) source[i] = static_cast<std::uint8_t>(i);
    test::on_every_target([&] {
      test::Unaligned<std::uint8_t> out(count, 3, 77);
      spread_limited(source.data(), out.data(), count);
      for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(out[i], spread(source[i])) << count << ' ' << i;
      EXPECT_TRUE(out.surroundings_are(77));
    });
  }
}

TEST(Luma, TakesEverySecondByteAsItIsOrSpread) {
  std::mt19937 random(2);
  for (const std::size_t count : test::lengths) {
    test::Unaligned<std::uint8_t> source(2 * count, 1);
    test::fill_bytes(source, random);
    test::on_every_target([&] {
      test::Unaligned<std::uint8_t> full(count, 1, 77);
      test::Unaligned<std::uint8_t> limited(count, 1, 77);
      even_bytes(source.data(), full.data(), count);
      spread_even_bytes(source.data(), limited.data(), count);
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ(full[i], source[2 * i]) << count << ' ' << i;
        ASSERT_EQ(limited[i], spread(source[2 * i])) << count << ' ' << i;
      }
      EXPECT_TRUE(full.surroundings_are(77));
      EXPECT_TRUE(limited.surroundings_are(77));
    });
  }
}

}  // namespace
}  // namespace eigenpose
