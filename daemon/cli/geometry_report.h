#pragma once

/// Tangent, normal and curvature of a model's manifolds, for `inspect --geometry`.

#include <nlohmann/json_fwd.hpp>

#include "core/model/model.h"

namespace eigenpose::cli {

/// At every learned value of each DOF (the others at their first): speed, curvature, tangent and normal.
nlohmann::json geometry_json(const ModelObject& object);

/// Prints a table: for each object and DOF how fast the appearance changes, and how sharply it bends where.
void print_geometry(const Model& model);

}  // namespace eigenpose::cli
