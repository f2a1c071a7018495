#pragma once

/// The part of a model file that holds windows and pose spaces.

#include <vector>

#include "core/model/hdf5_file.h"
#include "core/model/model.h"

namespace eigenpose {

/// @throws Hdf5Failure.
void write_parts(const Hdf5Group& group, const PartsModel& parts);
/// @param objects the model's objects, whose axes the pose spaces share. @throws Hdf5Failure,
/// std::invalid_argument for parts that do not fit together.
PartsModel read_parts(const Hdf5Group& group, const std::vector<ModelObject>& objects);

}  // namespace eigenpose
