#pragma once

/// A workspace as JSON, the same in image sets and on the API.

#include <nlohmann/json_fwd.hpp>

#include "core/base/workspace.h"

namespace eigenpose {

/// A list in the order of the DOFs: [{"name": "table", "unit": "deg", "lower": 0, "upper": 360, "periodic":
/// true}].
nlohmann::json workspace_json(const Workspace& workspace);

}  // namespace eigenpose
