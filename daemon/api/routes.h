#pragma once

/// The table of what the API offers, and what each entry does.

#include <memory>
#include <optional>

#include "daemon/api/event_log.h"
#include "daemon/api/http.h"
#include "daemon/api/simulation_info.h"
#include "daemon/service/service.h"

namespace eigenpose {

/// What the API shows.
struct ApiSources {
  Service& service;
  std::shared_ptr<const EventLog> results;
  std::optional<SimulationInfo> simulation;  ///< none: real devices
};

/// Answers requests. What the sources refer to must outlive the application.
Application make_application(const ApiSources& sources);

}  // namespace eigenpose
