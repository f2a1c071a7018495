#include "core/simd/threshold.h"

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

TEST(Threshold, SetsTheBitsOfPixelsAboveItAtAnyWidth) {
  std::mt19937 random(5);
  for (const std::size_t bands : {1U, 3U}) {
    for (const std::size_t width : {0U, 1U, 7U, 63U, 64U, 65U, 127U, 128U, 130U, 640U}) {
      for (const int threshold : {0, 1, 127, 128, 200, 254, 255}) {
        test::Unaligned<std::uint8_t> row(width * bands, 1,
                                          255);  // bright outside: must not be read as pixels
        test::fill_bytes(row, random);
        for (std::size_t i = 0; i < row.size(); i += 11) row[i] = static_cast<std::uint8_t>(threshold);
        const std::size_t words = (width + 63) / 64;
        std::vector<std::uint64_t> expected(words + 1, 0);
        for (std::size_t x = 0; x < width; ++x)
          for (std::size_t b = 0; b < bands; ++b)
            if (row[x * bands + b] > threshold) expected[x / 64] |= std::uint64_t{1} << (x % 64);
        expected[words] = 99;  // not written
        test::on_every_target([&] {
          std::vector<std::uint64_t> found(words + 1, 99);
          threshold_row(row.data(), static_cast<int>(width), static_cast<int>(bands),
                        static_cast<std::uint8_t>(threshold), found.data());
          ASSERT_EQ(found, expected) << bands << " bands, width " << width << ", threshold " << threshold;
        });
      }
    }
  }
}

TEST(Threshold, SeesEveryBandOfEveryPixelAlone) {
  for (std::size_t at = 0; at < 3 * 64; ++at) {
    std::vector<std::uint8_t> row(3 * 64, 100);
    row[at] = 101;
    test::on_every_target([&] {
      std::uint64_t bits = 0;
      threshold_row(row.data(), 64, 3, 100, &bits);
      ASSERT_EQ(bits, std::uint64_t{1} << (at / 3)) << at;
    });
  }
}

}  // namespace
}  // namespace eigenpose
