#pragma once

/// The one place where failures become answers of the API, and faults become HTTP status codes.

#include <exception>
#include <string>

#include "daemon/api/http.h"
#include "daemon/service/errors.h"

namespace eigenpose {

/// The HTTP status that stands for a kind of fault.
int http_status(Fault fault);

/// {"error": …, "hint": …} with the status.
Response error_response(int status, const std::string& error, const std::string& hint);
Response error_response(const std::exception_ptr& exception);

}  // namespace eigenpose
