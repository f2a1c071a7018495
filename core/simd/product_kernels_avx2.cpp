#include "core/simd/product_kernels.h"

#if defined(__x86_64__) && defined(__GNUC__)

#include <immintrin.h>

#define EIGENPOSE_AVX2 __attribute__((target("avx2,fma")))

namespace eigenpose {
namespace {

EIGENPOSE_AVX2 void widen(const std::uint8_t* bytes, std::size_t n, std::int16_t* words) {
  std::size_t k = 0;
  for (; k + 16 <= n; k += 16) {
    const __m128i raw = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes + k));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(words + k), _mm256_cvtepu8_epi16(raw));
  }
  for (; k < n; ++k) words[k] = bytes[k];
}

EIGENPOSE_AVX2 inline __m256i load(const std::int16_t* words) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(words));
}

/// sum + Σ of neighbouring products. Unsigned bytes times unsigned bytes need 16-bit operands: the 8-bit
/// multiply-add of AVX2 takes one side as signed and saturates.
EIGENPOSE_AVX2 inline __m256i accumulate(__m256i sum, __m256i x, __m256i y) {
  return _mm256_add_epi32(sum, _mm256_madd_epi16(x, y));
}

/// Adds the four totals of four accumulators to four neighbouring outputs. Each total fits 31 bits.
EIGENPOSE_AVX2 inline void add_totals(__m256i s0, __m256i s1, __m256i s2, __m256i s3, std::int64_t* out) {
  const __m256i pairs = _mm256_hadd_epi32(_mm256_hadd_epi32(s0, s1), _mm256_hadd_epi32(s2, s3));
  const __m128i totals = _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256(pairs, 1));
  __m256i* target = reinterpret_cast<__m256i*>(out);
  _mm256_storeu_si256(target, _mm256_add_epi64(_mm256_loadu_si256(target), _mm256_cvtepi32_epi64(totals)));
}

/// 3 × 4 dot products at once: twelve accumulators, three operands and one in flight fill the sixteen
/// registers.
EIGENPOSE_AVX2 inline void word_dots_3x4(const std::int16_t* a, std::size_t lda, const std::int16_t* b,
                                         std::size_t ldb, std::size_t length, std::int64_t* out,
                                         std::size_t ldo) {
  __m256i s00 = _mm256_setzero_si256(), s01 = s00, s02 = s00, s03 = s00;
  __m256i s10 = s00, s11 = s00, s12 = s00, s13 = s00;
  __m256i s20 = s00, s21 = s00, s22 = s00, s23 = s00;
  for (std::size_t k = 0; k < length; k += 16) {
    const __m256i x0 = load(a + k);
    const __m256i x1 = load(a + lda + k);
    const __m256i x2 = load(a + 2 * lda + k);
    __m256i y = load(b + k);
    s00 = accumulate(s00, x0, y);
    s10 = accumulate(s10, x1, y);
    s20 = accumulate(s20, x2, y);
    y = load(b + ldb + k);
    s01 = accumulate(s01, x0, y);
    s11 = accumulate(s11, x1, y);
    s21 = accumulate(s21, x2, y);
    y = load(b + 2 * ldb + k);
    s02 = accumulate(s02, x0, y);
    s12 = accumulate(s12, x1, y);
    s22 = accumulate(s22, x2, y);
    y = load(b + 3 * ldb + k);
    s03 = accumulate(s03, x0, y);
    s13 = accumulate(s13, x1, y);
    s23 = accumulate(s23, x2, y);
  }
  add_totals(s00, s01, s02, s03, out);
  add_totals(s10, s11, s12, s13, out + ldo);
  add_totals(s20, s21, s22, s23, out + 2 * ldo);
}

EIGENPOSE_AVX2 void word_dots(const std::int16_t* a, std::size_t lda, std::size_t m, const std::int16_t* b,
                              std::size_t ldb, std::size_t n, std::size_t length, std::int64_t* out,
                              std::size_t ldo) {
  for (std::size_t j = 0; j < n; j += 4) {
    for (std::size_t i = 0; i < m; i += 3) {
      word_dots_3x4(a + i * lda, lda, b + j * ldb, ldb, length, out + i * ldo + j, ldo);
    }
  }
}

/// (s₀+s₂)+(s₁+s₃): the order that every kernel set keeps.
EIGENPOSE_AVX2 inline double total(__m256d s) {
  const __m128d halves = _mm_add_pd(_mm256_castpd256_pd128(s), _mm256_extractf128_pd(s, 1));
  return _mm_cvtsd_f64(halves) + _mm_cvtsd_f64(_mm_unpackhi_pd(halves, halves));
}

EIGENPOSE_AVX2 inline double with_tail(double sum, const double* x, const double* y, std::size_t from,
                                       std::size_t to) {
  for (std::size_t k = from; k < to; ++k) sum += x[k] * y[k];
  return sum;
}

EIGENPOSE_AVX2 inline void dots_3x4(const double* a, std::size_t lda, const double* b, std::size_t ldb,
                                    std::size_t length, double* out, std::size_t ldo) {
  __m256d s00 = _mm256_setzero_pd(), s01 = s00, s02 = s00, s03 = s00;
  __m256d s10 = s00, s11 = s00, s12 = s00, s13 = s00;
  __m256d s20 = s00, s21 = s00, s22 = s00, s23 = s00;
  const std::size_t even = length - length % 4;
  for (std::size_t k = 0; k < even; k += 4) {
    const __m256d x0 = _mm256_loadu_pd(a + k);
    const __m256d x1 = _mm256_loadu_pd(a + lda + k);
    const __m256d x2 = _mm256_loadu_pd(a + 2 * lda + k);
    __m256d y = _mm256_loadu_pd(b + k);
    s00 = _mm256_fmadd_pd(x0, y, s00);
    s10 = _mm256_fmadd_pd(x1, y, s10);
    s20 = _mm256_fmadd_pd(x2, y, s20);
    y = _mm256_loadu_pd(b + ldb + k);
    s01 = _mm256_fmadd_pd(x0, y, s01);
    s11 = _mm256_fmadd_pd(x1, y, s11);
    s21 = _mm256_fmadd_pd(x2, y, s21);
    y = _mm256_loadu_pd(b + 2 * ldb + k);
    s02 = _mm256_fmadd_pd(x0, y, s02);
    s12 = _mm256_fmadd_pd(x1, y, s12);
    s22 = _mm256_fmadd_pd(x2, y, s22);
    y = _mm256_loadu_pd(b + 3 * ldb + k);
    s03 = _mm256_fmadd_pd(x0, y, s03);
    s13 = _mm256_fmadd_pd(x1, y, s13);
    s23 = _mm256_fmadd_pd(x2, y, s23);
  }
  const __m256d sums[3][4] = {{s00, s01, s02, s03}, {s10, s11, s12, s13}, {s20, s21, s22, s23}};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      out[i * ldo + j] += with_tail(total(sums[i][j]), a + i * lda, b + j * ldb, even, length);
    }
  }
}

EIGENPOSE_AVX2 inline double dot(const double* a, const double* b, std::size_t length) {
  __m256d s = _mm256_setzero_pd();
  const std::size_t even = length - length % 4;
  for (std::size_t k = 0; k < even; k += 4) {
    s = _mm256_fmadd_pd(_mm256_loadu_pd(a + k), _mm256_loadu_pd(b + k), s);
  }
  return with_tail(total(s), a, b, even, length);
}

EIGENPOSE_AVX2 void dots(const double* a, std::size_t lda, std::size_t m, const double* b, std::size_t ldb,
                         std::size_t n, std::size_t length, double* out, std::size_t ldo) {
  const std::size_t m3 = m - m % 3;
  const std::size_t n4 = n - n % 4;
  for (std::size_t i = 0; i < m; ++i) {
    if (i < m3 && i % 3 == 0) {
      for (std::size_t j = 0; j < n4; j += 4) {
        dots_3x4(a + i * lda, lda, b + j * ldb, ldb, length, out + i * ldo + j, ldo);
      }
    }
    for (std::size_t j = i < m3 ? n4 : 0; j < n; ++j)
      out[i * ldo + j] += dot(a + i * lda, b + j * ldb, length);
  }
}

EIGENPOSE_AVX2 inline void add_to(double* out, __m256d low, __m256d high) {
  _mm256_storeu_pd(out, _mm256_add_pd(_mm256_loadu_pd(out), low));
  _mm256_storeu_pd(out + 4, _mm256_add_pd(_mm256_loadu_pd(out + 4), high));
}

EIGENPOSE_AVX2 inline void combine_4x8(const double* a, std::size_t lda, const double* x, std::size_t ldx,
                                       std::size_t depth, double* out, std::size_t ldo) {
  __m256d s00 = _mm256_setzero_pd(), s01 = s00, s10 = s00, s11 = s00, s20 = s00, s21 = s00, s30 = s00,
          s31 = s00;
  for (std::size_t j = 0; j < depth; ++j) {
    const __m256d low = _mm256_loadu_pd(x + j * ldx);
    const __m256d high = _mm256_loadu_pd(x + j * ldx + 4);
    __m256d weight = _mm256_broadcast_sd(a + j);
    s00 = _mm256_fmadd_pd(weight, low, s00);
    s01 = _mm256_fmadd_pd(weight, high, s01);
    weight = _mm256_broadcast_sd(a + lda + j);
    s10 = _mm256_fmadd_pd(weight, low, s10);
    s11 = _mm256_fmadd_pd(weight, high, s11);
    weight = _mm256_broadcast_sd(a + 2 * lda + j);
    s20 = _mm256_fmadd_pd(weight, low, s20);
    s21 = _mm256_fmadd_pd(weight, high, s21);
    weight = _mm256_broadcast_sd(a + 3 * lda + j);
    s30 = _mm256_fmadd_pd(weight, low, s30);
    s31 = _mm256_fmadd_pd(weight, high, s31);
  }
  add_to(out, s00, s01);
  add_to(out + ldo, s10, s11);
  add_to(out + 2 * ldo, s20, s21);
  add_to(out + 3 * ldo, s30, s31);
}

EIGENPOSE_AVX2 inline void combine_1x8(const double* a, const double* x, std::size_t ldx, std::size_t depth,
                                       double* out) {
  __m256d s0 = _mm256_setzero_pd(), s1 = s0;
  for (std::size_t j = 0; j < depth; ++j) {
    const __m256d weight = _mm256_broadcast_sd(a + j);
    s0 = _mm256_fmadd_pd(weight, _mm256_loadu_pd(x + j * ldx), s0);
    s1 = _mm256_fmadd_pd(weight, _mm256_loadu_pd(x + j * ldx + 4), s1);
  }
  add_to(out, s0, s1);
}

EIGENPOSE_AVX2 void combine(const double* a, std::size_t lda, std::size_t rows, const double* x,
                            std::size_t ldx, std::size_t depth, std::size_t width, double* out,
                            std::size_t ldo) {
  const std::size_t rows4 = rows - rows % 4;
  for (std::size_t p = 0; p < width; p += 8) {
    for (std::size_t r = 0; r < rows4; r += 4) {
      combine_4x8(a + r * lda, lda, x + p, ldx, depth, out + r * ldo + p, ldo);
    }
    for (std::size_t r = rows4; r < rows; ++r) combine_1x8(a + r * lda, x + p, ldx, depth, out + r * ldo + p);
  }
}

}  // namespace

namespace detail {
const Kernels* avx2_kernels() {
  static const Kernels kernels{"avx2", widen, word_dots, dots, combine};
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &kernels : nullptr;
}
}  // namespace detail

}  // namespace eigenpose

#else

namespace eigenpose::detail {
const Kernels* avx2_kernels() {
  return nullptr;
}
}  // namespace eigenpose::detail

#endif
