#pragma once

/// The inner loops of learning: inner products of many rows with many, and weighted sums of rows. Any shape,
/// no alignment; outputs do not overlap inputs. Thread-safe.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// Rows of a matrix in memory.
template <class T>
struct Rows {
  const T* data;
  std::size_t stride;  ///< elements from one row to the next
  std::size_t count;
};

/// A matrix in memory to which a kernel adds.
template <class T>
struct Sums {
  T* data;
  std::size_t stride;  ///< elements from one row to the next
};

/// Widens n bytes to 16 bits.
void widen_bytes(const std::uint8_t* bytes, std::size_t n, std::int16_t* words);

/// out(i, j) += Σ_k a(i, k)·b(j, k) for the first `length` elements of each row, exactly: every target gives
/// the same integers. Fastest where a.count is a multiple of 3, b.count of 4 and `length` of 16.
/// @pre Σ_k |a·b| fits 31 bits: words of 0…255 up to length 32768, or rows of norm up to 46340.
void add_inner_products(const Rows<std::int16_t>& a, const Rows<std::int16_t>& b, std::size_t length,
                        const Sums<std::int64_t>& out);

/// The same in double: four running sums, k modulo 4, then (s₀+s₂)+(s₁+s₃), then the last length % 4
/// products, then the sum of all to out(i, j). Each entry depends on its two rows alone, not on the other
/// rows of the call. Where the doubles hold float values each product is exact, and every target gives the
/// same bits; elsewhere targets with fused multiply-add differ by the rounding of the products: the error is
/// below length·2⁻⁵³·Σ|a·b|.
void add_inner_products(const Rows<double>& a, const Rows<double>& b, std::size_t length,
                        const Sums<double>& out);

/// out(r, p) += Σ_j weights(r, j)·rows(j, p) for r < weights.count, p < width, j < rows.count, summed in the
/// order of j. The same machine gives the same bits each time, whatever the other rows and columns of the
/// call; targets differ by the rounding of the products: the error is below (rows.count + 1)·2⁻⁵³·Σ|w·x|.
void add_combinations(const Rows<double>& weights, const Rows<double>& rows, std::size_t width,
                      const Sums<double>& out);

}  // namespace eigenpose
