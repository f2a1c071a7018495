#include "daemon/service/errors.h"

#include <new>

namespace eigenpose {

Failure failure_of(const std::exception_ptr& exception) {
  try {
    std::rethrow_exception(exception);
  } catch (const ServiceError& error) {
    return {error.fault(), error.what(), error.hint()};
  } catch (const ConfigError& error) {
    return {Fault::invalid_request, error.what(), ""};  // the text says what is allowed
  } catch (const DeviceLost& error) {
    return {Fault::device, error.what(),
            "check that " + error.device() +
                " has power and its cable, then try again; `eigenpose status` shows it"};
  } catch (const DeviceTimeout& error) {
    return {Fault::device, error.what(),
            "check that " + error.device() + " is free to move and answers, then try again"};
  } catch (const DeviceError& error) {
    return {Fault::device, error.what(), "see what " + error.device() + " shows, clear it, then try again"};
  } catch (const FileError& error) {
    return {Fault::file, error.what(), ""};  // the text says what to do
  } catch (const Interrupted& error) {
    return {Fault::interrupted, error.what(), "start it again when you like: what was done is kept"};
  } catch (const Error& error) {
    return {Fault::internal, error.what(), "the log of eigenposed may say more"};
  } catch (const std::bad_alloc&) {
    return {Fault::internal, "out of memory", "fewer views or a smaller size need less"};
  } catch (const std::exception& error) {
    return {Fault::internal, error.what(), "this is a defect of eigenposed: please report it with its log"};
  } catch (...) {
    return {Fault::internal, "an exception of an unknown type",
            "this is a defect of eigenposed: please report it with its log"};
  }
}

}  // namespace eigenpose
