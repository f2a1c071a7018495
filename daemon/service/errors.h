#pragma once

/// What can be wrong with a request or a job, in the domain's own terms.

#include <exception>
#include <string>

#include "core/base/error.h"

namespace eigenpose {

/// Who has to do something about a failure, and what kind of thing.
enum class Fault {
  invalid_request,  ///< the caller asked for something that cannot be
  not_found,        ///< what the caller named is not there
  conflict,         ///< it cannot be done in the present state
  busy,             ///< other work must end first
  unavailable,      ///< what is asked for is not there at the moment: a frame, a model
  device,           ///< a device does not do what it should
  file,             ///< a file cannot be read or written
  interrupted,      ///< somebody asked for a stop
  internal,         ///< a defect of this program
};

/// A request that cannot be obeyed. `hint` is one sentence on what to do instead.
class ServiceError : public Error {
 public:
  ServiceError(Fault fault, const std::string& what, std::string hint)
      : Error(what), fault_(fault), hint_(std::move(hint)) {}
  [[nodiscard]] Fault fault() const { return fault_; }
  [[nodiscard]] const std::string& hint() const { return hint_; }

 private:
  Fault fault_;
  std::string hint_;
};

/// A failure as a value, in words for a person.
struct Failure {
  Fault fault = Fault::internal;
  std::string what;  ///< what happened
  std::string hint;  ///< what to do; may be empty when `what` says it
};

/// Puts any exception into words. Only exceptions that say so blame the caller: a std::invalid_argument or
/// std::out_of_range from inside is a defect of this program.
Failure failure_of(const std::exception_ptr& exception);

}  // namespace eigenpose
