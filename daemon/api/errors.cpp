#include "daemon/api/errors.h"

#include <nlohmann/json.hpp>

namespace eigenpose {

int http_status(Fault fault) {
  switch (fault) {
    case Fault::invalid_request:
      return 400;
    case Fault::not_found:
      return 404;
    case Fault::conflict:
    case Fault::busy:
    case Fault::interrupted:
      return 409;
    case Fault::unavailable:
    case Fault::device:
      return 503;
    case Fault::file:
    case Fault::internal:
      return 500;
  }
  return 500;
}

Response error_response(int status, const std::string& error, const std::string& hint) {
  const nlohmann::json body = {{"error", error}, {"hint", hint}};
  return {status,
          "application/json",
          body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
          {}};
}

Response error_response(const std::exception_ptr& exception) {
  const Failure failure = failure_of(exception);
  return error_response(http_status(failure.fault), failure.what, failure.hint);
}

}  // namespace eigenpose
