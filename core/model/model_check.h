#pragma once

/// Whether a model means something: beside being whole (sealed_file.h), its values are ones that learning can
/// make.

#include "core/model/model.h"

namespace eigenpose {

/// Checks names, sizes, that every number is finite and every threshold, rate and noise in its range, so that
/// nothing that recognises with the model meets an endless loop, a wild index or a NaN. Cost: one pass over
/// all numbers.
/// @throws std::invalid_argument: one clause saying what is wrong and what is allowed.
void check_model(const Model& model);

}  // namespace eigenpose
