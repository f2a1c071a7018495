#include "core/simd/dense_products.h"

#include <cmath>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

struct Sum {
  double value = 0.0;
  double tolerance = 0.0;  ///< n·2⁻²⁴·Σ|a·b|: what the header states

  void add(double a, double b) {
    value += a * b;
    magnitude_ += std::fabs(a * b);
    ++count_;
    tolerance = static_cast<double>(count_) * 0x1p-24 * magnitude_;
  }

 private:
  double magnitude_ = 0.0;
  int count_ = 0;
};

template <class A, class B>
Sum plain_dot(const A& a, std::size_t from, const B& b, std::size_t other, std::size_t n) {
  Sum sum;
  for (std::size_t i = 0; i < n; ++i) sum.add(a[from + i], b[other + i]);
  return sum;
}

TEST(DenseProducts, DotIsTheSumOfProductsAtEveryLengthAndOffset) {
  std::mt19937 random(1);
  for (const std::size_t n : test::lengths) {
    for (const std::size_t offset : {0U, 1U, 3U}) {
      test::Unaligned<float> a(n, offset, NAN);
      test::Unaligned<float> b(n, offset + 1, NAN);
      test::fill_normal(a, random);
      test::fill_normal(b, random);
      const Sum expected = plain_dot(a, 0, b, 0, n);
      test::on_every_target([&] {
        const float found = dot(a.data(), b.data(), static_cast<int>(n));
        EXPECT_NEAR(found, expected.value, expected.tolerance) << n;
        EXPECT_EQ(found, dot(a.data(), b.data(), static_cast<int>(n))) << "the same bits each time";
      });
    }
  }
}

TEST(DenseProducts, DotIsExactForSmallWholeNumbersOfAnySign) {
  std::mt19937 random(2);
  std::uniform_int_distribution<int> value(-100, 100);
  for (const std::size_t n : test::lengths) {
    std::vector<float> a(n);
    std::vector<float> b(n);
    for (float& x : a) x = static_cast<float>(value(random));
    for (float& x : b) x = static_cast<float>(value(random));
    const Sum expected = plain_dot(a, 0, b, 0, n);
    test::on_every_target(
        [&] { EXPECT_EQ(dot(a.data(), b.data(), static_cast<int>(n)), expected.value) << n; });
  }
}

TEST(DenseProducts, DotOverflowsToInfinityOnly) {
  const std::vector<float> large(65, 3e38F);
  test::on_every_target(
      [&] { EXPECT_EQ(dot(large.data(), large.data(), 65), std::numeric_limits<float>::infinity()); });
}

TEST(DenseProducts, MultiplyTransposedIsTheDotOfEveryColumn) {
  std::mt19937 random(3);
  for (const std::size_t rows : {1U, 7U, 8U, 33U, 77U}) {
    for (const std::size_t columns : {0U, 1U, 2U, 5U}) {
      test::Unaligned<float> matrix(rows * columns, 1);
      test::Unaligned<float> vector(rows, 3);
      test::fill_normal(matrix, random);
      test::fill_normal(vector, random);
      test::on_every_target([&] {
        test::Unaligned<float> out(columns, 1, 9.0F);
        multiply_transposed(matrix.data(), static_cast<int>(rows), static_cast<int>(columns), vector.data(),
                            out.data());
        for (std::size_t k = 0; k < columns; ++k) {
          const Sum expected = plain_dot(matrix, k * rows, vector, 0, rows);
          EXPECT_NEAR(out[k], expected.value, expected.tolerance);
          EXPECT_EQ(out[k], dot(matrix.data() + k * rows, vector.data(), static_cast<int>(rows)));
        }
        EXPECT_TRUE(out.surroundings_are(9.0F));
      });
    }
  }
}

TEST(DenseProducts, MultiplyTransposedSixTakesEveryColumnAndVector) {
  std::mt19937 random(4);
  for (const std::size_t rows : {1U, 4U, 8U, 15U, 77U, 1024U}) {
    for (const std::size_t columns : {0U, 1U, 2U, 3U, 5U}) {
      for (const std::size_t stride : {columns, columns + 2}) {
        test::Unaligned<float> matrix(rows * columns, 1);
        test::Unaligned<float> vectors(rows * 6, 2);
        test::fill_normal(matrix, random);
        test::fill_normal(vectors, random);
        test::on_every_target([&] {
          test::Unaligned<float> out(stride * 6, 1, 9.0F);
          multiply_transposed_six(matrix.data(), static_cast<int>(rows), static_cast<int>(columns),
                                  vectors.data(), out.data(), static_cast<int>(stride));
          for (std::size_t v = 0; v < 6; ++v) {
            for (std::size_t k = 0; k < stride; ++k) {
              if (k >= columns) {
                EXPECT_EQ(out[v * stride + k], 9.0F) << "what lies between the columns is left alone";
                continue;
              }
              const Sum expected = plain_dot(matrix, k * rows, vectors, v * rows, rows);
              EXPECT_NEAR(out[v * stride + k], expected.value, expected.tolerance)
                  << rows << ' ' << k << ' ' << v;
            }
          }
          EXPECT_TRUE(out.surroundings_are(9.0F));
        });
      }
    }
  }
}

TEST(DenseProducts, ResidualProductsAreThoseOfTheDifference) {
  std::mt19937 random(5);
  for (const std::size_t n : test::lengths) {
    test::Unaligned<float> point(n, 1);
    test::Unaligned<float> frame(6 * n, 3);
    test::fill_normal(point, random);
    test::fill_normal(frame, random);
    Sum squared;
    Sum products[5];
    for (std::size_t i = 0; i < n; ++i) {
      const float r = point[i] - frame[i];
      squared.add(r, r);
      for (std::size_t v = 0; v < 5; ++v) products[v].add(r, frame[(v + 1) * n + i]);
    }
    test::on_every_target([&] {
      float found = 9.0F;
      float found_products[5] = {9.0F, 9.0F, 9.0F, 9.0F, 9.0F};
      residual_products(point.data(), frame.data(), static_cast<int>(n), found, found_products);
      EXPECT_NEAR(found, squared.value, squared.tolerance) << n;
      for (std::size_t v = 0; v < 5; ++v)
        EXPECT_NEAR(found_products[v], products[v].value, products[v].tolerance) << n << ' ' << v;
    });
  }
}

}  // namespace
}  // namespace eigenpose
