#pragma once

/// The one place where exceptions become answers of the API.

#include <exception>
#include <string>

#include "core/base/error.h"
#include "daemon/api/http.h"

namespace eigenpose {

/// A request that cannot be obeyed, with its HTTP status and what to do instead.
class RequestError : public Error {
 public:
  RequestError(int status, const std::string& what, std::string hint)
      : Error(what), status_(status), hint_(std::move(hint)) {}
  [[nodiscard]] int status() const { return status_; }
  [[nodiscard]] const std::string& hint() const { return hint_; }

 private:
  int status_;
  std::string hint_;
};

/// What went wrong, in words for a person.
struct Trouble {
  int status = 500;   ///< HTTP status
  std::string error;  ///< what happened
  std::string hint;   ///< what to do
};

/// Puts any exception into words.
Trouble describe(const std::exception_ptr& failure);

/// {"error": …, "hint": …} with the status.
Response error_response(int status, const std::string& error, const std::string& hint);
Response error_response(const std::exception_ptr& failure);

}  // namespace eigenpose
