#include "core/simd/product_kernels.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Kernels, MultiplyBytesExactlyAtTheLargestValues) {
  // 255 · 255 in every place: signed 8-bit multiply-adds and 16-bit sums would saturate here.
  constexpr std::size_t kLength = 32768;
  const std::vector<std::int16_t> a(3 * kLength, 255);
  const std::vector<std::int16_t> b(4 * kLength, 255);
  for (const Kernels* kernels : {&portable_kernels(), &best_kernels()}) {
    std::vector<std::int64_t> out(12, 5);
    kernels->word_dots(a.data(), kLength, 3, b.data(), kLength, 4, kLength, out.data(), 4);
    for (const std::int64_t sum : out) EXPECT_EQ(sum, 5 + 255LL * 255 * 32768) << kernels->name;
  }
}

TEST(Kernels, GiveTheSameIntegersOnEveryMachine) {
  std::mt19937 random(1);
  constexpr std::size_t kLength = 112;
  std::vector<std::uint8_t> bytes(13 * kLength);
  for (auto& x : bytes) x = static_cast<std::uint8_t>(random());
  std::vector<std::int16_t> words(bytes.size()), portable_words(bytes.size());
  best_kernels().widen(bytes.data(), bytes.size(), words.data());
  portable_kernels().widen(bytes.data(), bytes.size(), portable_words.data());
  EXPECT_EQ(words, portable_words);

  const std::int16_t* a = words.data();
  const std::int16_t* b = words.data() + 5 * kLength;
  std::vector<std::int64_t> fast(6 * 9, 0), plain(6 * 9, 0);
  best_kernels().word_dots(a, kLength, 6, b, kLength, 8, kLength, fast.data(), 9);
  portable_kernels().word_dots(a, kLength, 6, b, kLength, 8, kLength, plain.data(), 9);
  EXPECT_EQ(fast, plain);
  std::int64_t expected = 0;
  for (std::size_t k = 0; k < kLength; ++k) expected += bytes[2 * kLength + k] * bytes[(5 + 7) * kLength + k];
  EXPECT_EQ(fast[2 * 9 + 7], expected);
}

TEST(Kernels, GiveTheSameBitsForFloatValuesInEveryShape) {
  std::mt19937 random(2);
  std::normal_distribution<float> normal;
  for (const std::size_t length : {1UL, 3UL, 4UL, 7UL, 64UL, 129UL}) {
    for (std::size_t m = 1; m <= 7; ++m) {
      for (std::size_t n = 1; n <= 9; ++n) {
        std::vector<double> a(m * length), b(n * length);
        for (auto& x : a) x = normal(random);
        for (auto& x : b) x = normal(random);
        std::vector<double> fast(m * n, 0.25), plain(m * n, 0.25);
        best_kernels().dots(a.data(), length, m, b.data(), length, n, length, fast.data(), n);
        portable_kernels().dots(a.data(), length, m, b.data(), length, n, length, plain.data(), n);
        ASSERT_EQ(fast, plain) << m << " x " << n << " x " << length;
      }
    }
  }
}

TEST(Kernels, CombineRowsLikeAMatrixProduct) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr std::size_t kRows = 7, kDepth = 5, kWidth = 16;
  std::vector<double> a(kRows * kDepth), x(kDepth * kWidth);
  for (auto& value : a) value = normal(random);
  for (auto& value : x) value = normal(random);
  for (const Kernels* kernels : {&portable_kernels(), &best_kernels()}) {
    std::vector<double> out(kRows * kWidth, 1.0);
    kernels->combine(a.data(), kDepth, kRows, x.data(), kWidth, kDepth, kWidth, out.data(), kWidth);
    for (std::size_t r = 0; r < kRows; ++r) {
      for (std::size_t p = 0; p < kWidth; ++p) {
        double expected = 1.0;
        for (std::size_t j = 0; j < kDepth; ++j) expected += a[r * kDepth + j] * x[j * kWidth + p];
        EXPECT_NEAR(out[r * kWidth + p], expected, 1e-13) << kernels->name;  // five products of order one
      }
    }
  }
}

}  // namespace
}  // namespace eigenpose
