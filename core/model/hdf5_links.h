#pragma once

/// HDF5 groups that models and kept views have in common. Everything here throws Hdf5Failure; reading throws
/// std::invalid_argument for an image type that is not known, too.

#include "core/image/normalization.h"
#include "core/manifold/axis_basis.h"
#include "core/model/hdf5_file.h"

namespace eigenpose {

/// Attributes size, color, type, cropped, …
void write_normalization(const Hdf5Group& group, const NormalizationOptions& options);
NormalizationOptions read_normalization(const Hdf5Group& group);

/// Attributes name, unit, lower, upper, periodic; samples (n).
void write_axis(const Hdf5Group& group, const SampleAxis& axis);
SampleAxis read_axis(const Hdf5Group& group);

}  // namespace eigenpose
