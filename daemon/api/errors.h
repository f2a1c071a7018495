#pragma once

/// The one place where failures become answers of the API, and faults become HTTP status codes.

#include <exception>
#include <string>
#include <utility>

#include "daemon/api/http.h"
#include "daemon/service/errors.h"

namespace eigenpose {

/// The HTTP status that stands for a kind of fault.
int http_status(Fault fault);

/// The body of a request is of a type or coding that is not read here.
class UnsupportedMediaType : public Error {
 public:
  UnsupportedMediaType(const std::string& what, std::string hint) : Error(what), hint_(std::move(hint)) {}
  [[nodiscard]] const std::string& hint() const { return hint_; }

 private:
  std::string hint_;
};

/// {"error": …, "hint": …} with the status of the failure. Of a fault of the service itself the client learns
/// no more than that; the detail is logged.
Response error_response(const std::exception_ptr& exception);

}  // namespace eigenpose
