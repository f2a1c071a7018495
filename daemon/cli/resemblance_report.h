#pragma once

/// What looks alike in a model: objects, and poses of one object. For `learn` and `inspect`.

#include <nlohmann/json_fwd.hpp>

#include "core/model/model.h"

namespace eigenpose::cli {

/// {"objects": […], "poses": […]}: names, both poses, distance, and the share of poses that look alike.
nlohmann::json resemblance_json(const Model& model);

/// Prints the closest of each kind with the poses where they are closest; nothing where all differs.
void print_resemblance(const Model& model);

}  // namespace eigenpose::cli
