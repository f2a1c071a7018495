#pragma once

/// Small dense products for the per-frame path. They choose AVX2 and FMA at run time where the machine has
/// them.

namespace eigenpose {

/// out[k] = column k of `matrix` · `vector`, for `columns` columns of `rows` floats each (column-major, no
/// gaps).
void multiply_transposed(const float* matrix, int rows, int columns, const float* vector, float* out);

/// out (columns × 6, column-major, `stride` floats from column to column) = matrixᵀ · vectors, for six
/// vectors of `rows` floats that stand one after the other.
void multiply_transposed_six(const float* matrix, int rows, int columns, const float* vectors, float* out,
                             int stride);

/// With r = point − f: squared = ‖r‖² and products[i] = r·Jᵢ, where f and the five J stand one after the
/// other in `frame`, n floats each.
void residual_products(const float* point, const float* frame, int n, float& squared, float* products);

/// Scalar product of two arrays of n floats.
float dot(const float* a, const float* b, int n);

}  // namespace eigenpose
