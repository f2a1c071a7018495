#include "core/simd/product_kernels.h"

namespace eigenpose {
namespace {

void widen(const std::uint8_t* bytes, std::size_t n, std::int16_t* words) {
  for (std::size_t k = 0; k < n; ++k) words[k] = bytes[k];
}

void word_dots(const std::int16_t* a, std::size_t lda, std::size_t m, const std::int16_t* b, std::size_t ldb,
               std::size_t n, std::size_t length, std::int64_t* out, std::size_t ldo) {
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const std::int16_t* x = a + i * lda;
      const std::int16_t* y = b + j * ldb;
      std::int32_t sum = 0;
      for (std::size_t k = 0; k < length; ++k) sum += static_cast<std::int32_t>(x[k]) * y[k];
      out[i * ldo + j] += sum;
    }
  }
}

void dots(const double* a, std::size_t lda, std::size_t m, const double* b, std::size_t ldb, std::size_t n,
          std::size_t length, double* out, std::size_t ldo) {
  const std::size_t even = length - length % 4;
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const double* x = a + i * lda;
      const double* y = b + j * ldb;
      double s[4] = {};
      for (std::size_t k = 0; k < even; k += 4) {
        for (std::size_t l = 0; l < 4; ++l) s[l] += x[k + l] * y[k + l];
      }
      double sum = (s[0] + s[2]) + (s[1] + s[3]);
      for (std::size_t k = even; k < length; ++k) sum += x[k] * y[k];
      out[i * ldo + j] += sum;
    }
  }
}

void combine(const double* a, std::size_t lda, std::size_t rows, const double* x, std::size_t ldx,
             std::size_t depth, std::size_t width, double* out, std::size_t ldo) {
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t p = 0; p < width; p += 8) {
      double s[8] = {};
      for (std::size_t j = 0; j < depth; ++j) {
        const double weight = a[r * lda + j];
        const double* row = x + j * ldx + p;
        for (std::size_t l = 0; l < 8; ++l) s[l] += weight * row[l];
      }
      for (std::size_t l = 0; l < 8; ++l) out[r * ldo + p + l] += s[l];
    }
  }
}

}  // namespace

const Kernels& portable_kernels() {
  static const Kernels kernels{"portable", widen, word_dots, dots, combine};
  return kernels;
}

const Kernels& best_kernels() {
  static const Kernels& kernels = detail::avx2_kernels() ? *detail::avx2_kernels() : portable_kernels();
  return kernels;
}

}  // namespace eigenpose
