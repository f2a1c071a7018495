#include "core/simd/gram_products.h"

#include <cmath>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

using WordRows = Rows<std::int16_t>;
using WordSums = Sums<std::int64_t>;
using DoubleRows = Rows<double>;
using DoubleSums = Sums<double>;

TEST(GramProducts, MultiplyBytesExactlyAtTheLargestValues) {
  // 255 · 255 in every place: signed 8-bit multiply-adds and 16-bit sums would saturate here.
  constexpr std::size_t length = 32768;
  const std::vector<std::int16_t> a(3 * length, 255);
  const std::vector<std::int16_t> b(4 * length, 255);
  test::on_every_target([&] {
    std::vector<std::int64_t> out(12, 5);
    add_inner_products(WordRows{a.data(), length, 3}, WordRows{b.data(), length, 4}, length,
                       WordSums{out.data(), 4});
    for (const std::int64_t sum : out) EXPECT_EQ(sum, 5 + 255LL * 255 * 32768);
  });
}

TEST(GramProducts, MultiplyWordsExactlyAtTheSmallestValues) {
  // −32768 twice, with itself: the one pair of words whose sum of products fits no signed 32 bits is not in
  // the licence; a single one is.
  std::vector<std::int16_t> a(3 * 16, 0);
  std::vector<std::int16_t> b(4 * 16, 0);
  for (std::size_t r = 0; r < 3; ++r) a[r * 16 + 5] = -32768;
  for (std::size_t r = 0; r < 4; ++r) b[r * 16 + 5] = r % 2 == 0 ? std::int16_t{-32768} : std::int16_t{32767};
  test::on_every_target([&] {
    std::vector<std::int64_t> out(12, -1);
    add_inner_products(WordRows{a.data(), 16, 3}, WordRows{b.data(), 16, 4}, 16, WordSums{out.data(), 4});
    for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(out[i], -1 + (i % 2 == 0 ? 1073741824LL : -1073709056LL));
  });
}

TEST(GramProducts, AreExactIntegersInEveryShape) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> value(-3000, 3000);
  for (const std::size_t length : {0U, 1U, 7U, 8U, 15U, 16U, 17U, 32U, 33U, 112U}) {
    for (const std::size_t m : {0U, 1U, 2U, 3U, 4U, 6U, 7U}) {
      for (const std::size_t n : {0U, 1U, 3U, 4U, 5U, 8U, 9U}) {
        const std::size_t stride = length + 3;
        test::Unaligned<std::int16_t> a(m * stride, 1);
        test::Unaligned<std::int16_t> b(n * stride, 3);
        for (std::size_t i = 0; i < a.size(); ++i) a[i] = static_cast<std::int16_t>(value(random));
        for (std::size_t i = 0; i < b.size(); ++i) b[i] = static_cast<std::int16_t>(value(random));
        test::on_every_target([&] {
          test::Unaligned<std::int64_t> out(m * (n + 2), 1, 7);
          add_inner_products(WordRows{a.data(), stride, m}, WordRows{b.data(), stride, n}, length,
                             WordSums{out.data(), n + 2});
          for (std::size_t i = 0; i < m; ++i) {
            for (std::size_t j = 0; j < n + 2; ++j) {
              std::int64_t expected = 7;
              for (std::size_t k = 0; j < n && k < length; ++k)
                expected += a[i * stride + k] * b[j * stride + k];
              ASSERT_EQ(out[i * (n + 2) + j], expected)
                  << m << " x " << n << " x " << length << ": " << i << ' ' << j;
            }
          }
          ASSERT_TRUE(out.surroundings_are(7));
        });
      }
    }
  }
}

TEST(GramProducts, WidenEveryByte) {
  std::mt19937 random(2);
  for (const std::size_t n : test::lengths) {
    test::Unaligned<std::uint8_t> bytes(n, 1);
    test::fill_bytes(bytes, random);
    if (n > 1) bytes[n - 1] = 255;
    test::on_every_target([&] {
      test::Unaligned<std::int16_t> words(n, 1, -5);
      widen_bytes(bytes.data(), n, words.data());
      for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(words[i], bytes[i]);
      EXPECT_TRUE(words.surroundings_are(-5));
    });
  }
}

/// In the order that the header states.
double ordered_sum(const double* a, const double* b, std::size_t length) {
  double s[4] = {};
  const std::size_t whole = length - length % 4;
  for (std::size_t k = 0; k < whole; ++k) s[k % 4] += a[k] * b[k];
  double sum = (s[0] + s[2]) + (s[1] + s[3]);
  for (std::size_t k = whole; k < length; ++k) sum += a[k] * b[k];
  return sum;
}

TEST(GramProducts, OfFloatValuesHaveTheStatedBitsInEveryShape) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (const std::size_t length : {0U, 1U, 3U, 4U, 7U, 64U, 129U}) {
    for (std::size_t m = 0; m <= 7; ++m) {
      for (std::size_t n = 0; n <= 9; ++n) {
        test::Unaligned<double> a(m * length, 1);
        test::Unaligned<double> b(n * length, 1);
        for (std::size_t i = 0; i < a.size(); ++i) a[i] = static_cast<double>(normal(random));
        for (std::size_t i = 0; i < b.size(); ++i) b[i] = static_cast<double>(normal(random));
        test::on_every_target([&] {
          test::Unaligned<double> out(m * n, 1, 0.25);
          add_inner_products(DoubleRows{a.data(), length, m}, DoubleRows{b.data(), length, n}, length,
                             DoubleSums{out.data(), n});
          for (std::size_t i = 0; i < m; ++i)
            for (std::size_t j = 0; j < n; ++j)
              ASSERT_EQ(out[i * n + j],
                        0.25 + ordered_sum(a.data() + i * length, b.data() + j * length, length))
                  << m << " x " << n << " x " << length;
          ASSERT_TRUE(out.surroundings_are(0.25));
        });
      }
    }
  }
}

TEST(GramProducts, OfDoublesDependOnTheirTwoRowsAlone) {
  std::mt19937 random(4);
  constexpr std::size_t length = 131;
  std::vector<double> a(7 * length);
  std::vector<double> b(9 * length);
  test::fill_normal(a, random);
  test::fill_normal(b, random);
  test::on_every_target([&] {
    std::vector<double> together(7 * 9, 0.0);
    add_inner_products(DoubleRows{a.data(), length, 7}, DoubleRows{b.data(), length, 9}, length,
                       DoubleSums{together.data(), 9});
    for (std::size_t i = 0; i < 7; ++i) {
      for (std::size_t j = 0; j < 9; ++j) {
        double alone = 0.0;
        add_inner_products(DoubleRows{a.data() + i * length, length, 1},
                           DoubleRows{b.data() + j * length, length, 1}, length, DoubleSums{&alone, 1});
        EXPECT_EQ(together[i * 9 + j], alone);
        double sum = 0.0;
        double magnitude = 0.0;
        for (std::size_t k = 0; k < length; ++k) {
          sum += a[i * length + k] * b[j * length + k];
          magnitude += std::fabs(a[i * length + k] * b[j * length + k]);
        }
        EXPECT_NEAR(alone, sum, 2.0 * length * 0x1p-53 * magnitude);  // once for either sum
      }
    }
  });
}

TEST(GramProducts, CombineRowsLikeAMatrixProductInEveryShape) {
  std::mt19937 random(5);
  for (const std::size_t count : {0U, 1U, 3U, 4U, 5U, 9U}) {
    for (const std::size_t depth : {0U, 1U, 5U, 24U}) {
      for (const std::size_t width : {0U, 1U, 3U, 7U, 8U, 9U, 16U, 21U}) {
        test::Unaligned<double> weights(count * (depth + 1), 1);
        test::Unaligned<double> rows(depth * (width + 2), 1);
        test::fill_normal(weights, random);
        test::fill_normal(rows, random);
        test::on_every_target([&] {
          test::Unaligned<double> out(count * (width + 1), 1, 0.5);
          add_combinations({weights.data(), depth + 1, count}, {rows.data(), width + 2, depth}, width,
                           {out.data(), width + 1});
          for (std::size_t r = 0; r < count; ++r) {
            for (std::size_t p = 0; p <= width; ++p) {
              double expected = 0.5;
              double magnitude = 0.5;
              for (std::size_t j = 0; p < width && j < depth; ++j) {
                const double product = weights[r * (depth + 1) + j] * rows[j * (width + 2) + p];
                expected += product;
                magnitude += std::fabs(product);
              }
              // Both this sum and the kernel's are within the bound of the header.
              ASSERT_NEAR(out[r * (width + 1) + p], expected,
                          2.0 * static_cast<double>(depth + 1) * 0x1p-53 * magnitude)
                  << count << ' ' << depth << ' ' << width;
            }
          }
          ASSERT_TRUE(out.surroundings_are(0.5));
        });
      }
    }
  }
}

TEST(GramProducts, CombinationsDependOnTheirRowAndColumnAlone) {
  std::mt19937 random(6);
  constexpr std::size_t depth = 17;
  constexpr std::size_t width = 32;
  std::vector<double> weights(6 * depth);
  std::vector<double> rows(depth * width);
  test::fill_normal(weights, random);
  test::fill_normal(rows, random);
  test::on_every_target([&] {
    std::vector<double> together(6 * width, 0.0);
    add_combinations({weights.data(), depth, 6}, {rows.data(), width, depth}, width,
                     {together.data(), width});
    for (std::size_t r = 0; r < 6; ++r) {
      for (std::size_t p = 0; p < width; ++p) {
        double alone = 0.0;
        add_combinations({weights.data() + r * depth, depth, 1}, {rows.data() + p, width, depth}, 1,
                         {&alone, 1});
        EXPECT_EQ(together[r * width + p], alone) << r << ' ' << p;
      }
    }
  });
}

}  // namespace
}  // namespace eigenpose
