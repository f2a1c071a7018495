#pragma once

/// A client of eigenposed's API over its Unix socket, for the command line and for programs in C++.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"
#include "core/base/progress.h"

namespace eigenpose {

/// The service has refused. The text is "error; hint".
class ApiError : public Error {
 public:
  ApiError(int status, const std::string& error, const std::string& hint);
  [[nodiscard]] int status() const { return status_; }  ///< HTTP status

 private:
  int status_;
};

/// One server-sent event.
struct ApiEvent {
  std::string name;      ///< "result", "lost"
  std::uint64_t id = 0;  ///< its sequence number; that of the last result for "lost"
  std::string run;       ///< of the service, within which the number counts
  std::string data;      ///< JSON
};

/// Each call is a connection of its own. One thread at a time. Calls throw ApiError when the service refuses,
/// FileError when nobody answers on the socket, Error when the answer is late or is none.
class ApiClient {
 public:
  explicit ApiClient(std::filesystem::path socket,
                     std::chrono::milliseconds timeout = std::chrono::seconds(30));

  [[nodiscard]] const std::filesystem::path& socket() const { return socket_; }

  [[nodiscard]] nlohmann::json get(std::string_view target) const;
  /// An empty `body` sends none.
  nlohmann::json post(std::string_view target, const nlohmann::json& body) const;
  nlohmann::json remove(std::string_view target) const;  ///< DELETE
  /// The answer's bytes as they are: a picture.
  [[nodiscard]] std::string get_bytes(std::string_view target) const;

  /// Reads a stream of events until `handle` returns false, the service ends it, or `stop` is requested.
  void follow(std::string_view target, const std::function<bool(const ApiEvent&)>& handle,
              const std::stop_token& stop = {}) const;

  /// Waits for a job to end. @return the job. @throws ApiError when it failed or was cancelled; Interrupted
  /// on `stop`, and then the job has been cancelled too, unless it ended at that moment: then as without.
  nlohmann::json wait_for_job(const std::string& id, const Progress& progress = {},
                              const std::stop_token& stop = {}) const;

 private:
  struct Reply {
    int status = 0;
    std::string body;
  };
  [[nodiscard]] Reply ask(std::string_view method, std::string_view target, const std::string& body) const;
  [[nodiscard]] nlohmann::json ask_json(std::string_view method, std::string_view target,
                                        const std::string& body) const;

  std::filesystem::path socket_;
  std::chrono::milliseconds timeout_;
};

/// Splits a stream into server-sent events, fed in pieces of any size.
class EventParser {
 public:
  /// @param handle is called for each whole event. @return false once it returned false.
  bool feed(std::string_view piece, const std::function<bool(const ApiEvent&)>& handle);

 private:
  bool end_line(const std::function<bool(const ApiEvent&)>& handle);

  std::string line_;
  ApiEvent event_;
  bool has_data_ = false;
};

}  // namespace eigenpose
