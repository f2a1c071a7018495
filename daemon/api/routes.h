#pragma once

/// The table of what the API offers, and what each entry does.

#include "daemon/api/http.h"
#include "daemon/service/service.h"

namespace eigenpose {

/// Answers requests with `service`, which must outlive the handler.
Handler make_handler(Service& service);

}  // namespace eigenpose
