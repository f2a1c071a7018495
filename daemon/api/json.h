#pragma once

/// The API's JSON: one function a thing. Numbers carry their unit in the key; keys are stable.

#include <nlohmann/json_fwd.hpp>

#include "daemon/api/routes.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/rig.h"
#include "daemon/service/jobs.h"
#include "daemon/service/service.h"

namespace eigenpose {

nlohmann::json to_json(const CameraStatus& camera);
nlohmann::json to_json(const AxisStatus& axis);
nlohmann::json to_json(const JobStatus& job);
nlohmann::json status_json(const ApiSources& sources);
nlohmann::json objects_json(const Service& service);

}  // namespace eigenpose
