#pragma once

/// Samples a picture and its gradient through a similarity (shift, rotation, scale), bilinearly: the inner
/// loop of alignment. Every target gives the same bits: each operation is rounded by itself. Thread-safe.

#include <cstddef>

namespace eigenpose {

/// A square picture with its gradient. Outside its edge the picture goes on as it ends.
struct GradientPicture {
  const float* texels;  ///< side × side, row by row, of 4 floats: value, ∂/∂x, ∂/∂y, not used; unaligned
  int side;             ///< at least 2
};

/// Where the pixels of a side × side result are sampled: pixel (column, row) at (x + dx, y + dy) in pixels of
/// the picture, with (dx, dy) = (cosine·u − sine·v, sine·u + cosine·v), u = (column + ½)·step − middle and
/// v = (row + ½)·step − middle. Whatever the values, nothing outside the picture is read.
struct SimilaritySampling {
  int side;      ///< of the result
  float step;    ///< pixels of the picture per pixel of the result, before scaling
  float middle;  ///< half the picture's side
  float x;
  float y;
  float cosine;  ///< scale · cos(rotation)
  float sine;    ///< scale · sin(rotation)
};

/// Rows of the derivatives of the sampled values, side² floats each.
struct SimilarityDerivatives {
  float* by_x;         ///< ∂/∂x: after the sampling's x
  float* by_y;         ///< ∂/∂y
  float* by_scale;     ///< ∂/∂x·dx + ∂/∂y·dy: after the logarithm of the scale
  float* by_rotation;  ///< ∂/∂y·dx − ∂/∂x·dy: after the rotation in radians
};

/// @param values gets side² floats, row by row.
void sample_similarity(const GradientPicture& picture, const SimilaritySampling& sampling, float* values);

/// The same values, with their derivatives.
void sample_similarity(const GradientPicture& picture, const SimilaritySampling& sampling, float* values,
                       const SimilarityDerivatives& derivatives);

}  // namespace eigenpose
