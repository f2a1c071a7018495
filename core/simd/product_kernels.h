#pragma once

/// The three inner loops of learning, chosen at run time for the machine's instructions.

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace eigenpose {

/// One set of inner loops. All sets give the same bits in `word_dots` (integers), and in `dots` where the
/// doubles hold float values (each product is then exact, and every set adds in the same order). Thread-safe:
/// no state.
struct Kernels {
  std::string_view name;  ///< "avx2", "portable"

  /// Widens n bytes to 16 bits.
  void (*widen)(const std::uint8_t* bytes, std::size_t n, std::int16_t* words);

  /// out[i·ldo + j] += Σ_k a[i·lda + k]·b[j·ldb + k] for i < m, j < n, k < length, exactly.
  /// @pre m % 3 == 0, n % 4 == 0, length % 16 == 0, and Σ_k |a·b| fits 31 bits: words of 0…255 up to length
  /// 32768, or rows of norm up to 46340.
  void (*word_dots)(const std::int16_t* a, std::size_t lda, std::size_t m, const std::int16_t* b,
                    std::size_t ldb, std::size_t n, std::size_t length, std::int64_t* out, std::size_t ldo);

  /// out[i·ldo + j] += Σ_k a[i·lda + k]·b[j·ldb + k] in double: four running sums, k modulo 4, then
  /// (s₀+s₂)+(s₁+s₃), then the last length % 4 products. Any m, n, length.
  void (*dots)(const double* a, std::size_t lda, std::size_t m, const double* b, std::size_t ldb,
               std::size_t n, std::size_t length, double* out, std::size_t ldo);

  /// out[r·ldo + p] += Σ_j a[r·lda + j]·x[j·ldx + p] for r < rows, p < width, j < depth. @pre width % 8 == 0.
  void (*combine)(const double* a, std::size_t lda, std::size_t rows, const double* x, std::size_t ldx,
                  std::size_t depth, std::size_t width, double* out, std::size_t ldo);
};

/// The loops that run on every machine.
const Kernels& portable_kernels();
/// The fastest loops that this machine can run.
const Kernels& best_kernels();

namespace detail {
/// Loops with AVX2 and FMA, or null where the machine or the compiler has none.
const Kernels* avx2_kernels();
}  // namespace detail

}  // namespace eigenpose
