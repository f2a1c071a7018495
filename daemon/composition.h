#pragma once

/// From the configuration to what the service and its API are made of. Opens no device and makes no file.

#include "config/config.h"
#include "daemon/api/server.h"
#include "daemon/service/service.h"

namespace eigenpose {

/// @throws ConfigError for a plan that the axes cannot follow ("FILE:LINE: …") and an image type that is not
/// known.
ServiceOptions service_options(const Config& config);

ServerOptions server_options(const ApiOptions& api);

}  // namespace eigenpose
