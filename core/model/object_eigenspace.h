#pragma once

/// The eigenspace of one object's views alone (section 3.2 of the paper), for its pose and for a second look.

#include <algorithm>

#include "core/image/normalization.h"
#include "core/manifold/manifold.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

/// Appearances are reduced to at most 32×32, then of unit energy again. The basis spans all views, so that a
/// point of the manifold stands for the interpolated view itself, and distances are comparable between
/// objects.
struct ObjectEigenspace {
  Eigenspace eigenspace;
  Manifold manifold;
  /// Left-out views are found closer to their pose here than in the universal eigenspace.
  bool better_pose = false;
};

/// Side of the reduced appearances of a model.
inline int reduced_side(const NormalizationOptions& options) {
  return std::min(options.size, 32);
}

}  // namespace eigenpose
