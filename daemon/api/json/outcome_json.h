#pragma once

/// What recognition says of a region, as JSON: the same on the API and from the commands that need no
/// service.

#include <nlohmann/json_fwd.hpp>

#include "core/model/model.h"
#include "core/recognition/outcome.h"

namespace eigenpose {

/// One outcome; daemon/api/README.md describes its keys. A value that cannot be observed (the turn of an
/// object that looks the same all round) is null wherever it stands.
/// @param model has the DOFs of each object; it made the outcome.
nlohmann::json outcome_json(const Outcome& outcome, const Model& model);

}  // namespace eigenpose
