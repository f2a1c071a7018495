#include "daemon/api/errors.h"

#include <new>

#include <nlohmann/json.hpp>

namespace eigenpose {

Trouble describe(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const RequestError& error) {
    return {error.status(), error.what(), error.hint()};
  } catch (const nlohmann::json::exception& error) {
    return {400, std::string("the body is not the JSON this needs: ") + error.what(),
            "see the API's description"};
  } catch (const ConfigError& error) {
    return {400, error.what(), ""};  // the text says what is allowed
  } catch (const DeviceLost& error) {
    return {503, error.what(),
            "check that " + error.device() +
                " has power and its cable, then try again; `eigenpose status` shows it"};
  } catch (const DeviceTimeout& error) {
    return {503, error.what(),
            "check that " + error.device() + " is free to move and answers, then try again"};
  } catch (const DeviceError& error) {
    return {503, error.what(), "see what " + error.device() + " shows, clear it, then try again"};
  } catch (const FileError& error) {
    return {500, error.what(), ""};  // the text says what to do
  } catch (const Interrupted& error) {
    return {409, error.what(), "start it again when you like: what was done is kept"};
  } catch (const std::invalid_argument& error) {
    return {400, error.what(), "change the request and try again"};
  } catch (const std::out_of_range& error) {
    return {400, error.what(), "stay within the range of the axis"};
  } catch (const Error& error) {
    return {500, error.what(), "the log of eigenposed may say more"};
  } catch (const std::bad_alloc&) {
    return {500, "out of memory", "fewer views or a smaller size need less"};
  } catch (const std::exception& error) {
    return {500, error.what(), "this is a fault of eigenposed: please report it with its log"};
  }
}

Response error_response(int status, const std::string& error, const std::string& hint) {
  const nlohmann::json body = {{"error", error}, {"hint", hint}};
  return {status,
          "application/json",
          body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
          {}};
}

Response error_response(const std::exception_ptr& failure) {
  const Trouble trouble = describe(failure);
  return error_response(trouble.status, trouble.error, trouble.hint);
}

}  // namespace eigenpose
