#pragma once

/// A request and its answer as plain values: what the routes see of HTTP.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <variant>

namespace eigenpose {

class EventLog;

/// What a socket lets its clients do.
enum class Access { read, control };

struct Request {
  std::string method;                        ///< "GET", "POST", "DELETE", …
  std::string path;                          ///< decoded, without the query: "/v1/jobs/7"
  std::map<std::string, std::string> query;  ///< decoded
  std::string body;
  std::string last_event_id;     ///< the header of that name; empty if it is not there
  Access access = Access::read;  ///< of the socket it came in by
};

struct Response {
  int status = 200;
  std::string content_type = "application/json";
  std::string body;
  std::map<std::string, std::string> headers;  ///< beside the usual ones
};

/// An answer that goes on until the client leaves: server-sent events.
struct EventStream {
  std::shared_ptr<const EventLog> log;
  std::string event;        ///< name of each event: "result"
  std::uint64_t after = 0;  ///< the last sequence number the client has seen
};

using Answer = std::variant<Response, EventStream>;

/// Answers a request. Called on the server's thread: must not block; must not throw.
using Handler = std::function<Answer(const Request&)>;

}  // namespace eigenpose
