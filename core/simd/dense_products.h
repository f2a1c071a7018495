#pragma once

/// Small dense products of the per-frame path, in float. Matrices are column-major without gaps; no pointer
/// needs alignment. Thread-safe.
///
/// Exactness: a sum of n products is added in an order (and with or without fused operations) that depends on
/// the target, but not on anything else: the same machine gives the same bits each time. Its error is below
/// n·2⁻²⁴·Σ|aᵢ·bᵢ|, whatever the order.

namespace eigenpose {

/// out[k] = column k of `matrix` · `vector`, for `columns` columns of `rows` floats each. The same bits as
/// `dot` of each column.
void multiply_transposed(const float* matrix, int rows, int columns, const float* vector, float* out);

/// out (columns × 6, `stride` ≥ columns floats from column to column; what lies between is not written) =
/// matrixᵀ · vectors, for six vectors of `rows` floats that stand one after the other.
void multiply_transposed_six(const float* matrix, int rows, int columns, const float* vectors, float* out,
                             int stride);

/// With r = point − f: squared = ‖r‖² and products[i] = r·Jᵢ, where f and the five J stand one after the
/// other in `frame`, n floats each.
void residual_products(const float* point, const float* frame, int n, float& squared, float* products);

/// Scalar product of two arrays of n floats; 0 for n = 0.
float dot(const float* a, const float* b, int n);

}  // namespace eigenpose
