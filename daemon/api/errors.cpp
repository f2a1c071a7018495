#include "daemon/api/errors.h"

#include <spdlog/spdlog.h>

#include "core/base/printable.h"

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

Response error_response(const std::exception_ptr& exception) {
  try {
    std::rethrow_exception(exception);
  } catch (const UnsupportedMediaType& error) {
    return error_response(415, error.what(), error.hint());
  } catch (...) {
    const Failure failure = failure_of(exception);
    if (failure.fault != Fault::internal)
      return error_response(http_status(failure.fault), failure.what, failure.hint);
    spdlog::error("event=request_failed error=\"{}\"", printable(failure.what));
    return error_response(500, "eigenposed failed to answer", "its log says why; please report it");
  }
}

}  // namespace eigenpose
