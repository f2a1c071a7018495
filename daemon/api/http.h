#pragma once

/// A request and its answer as plain values: what the routes see of HTTP.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <variant>

namespace eigenpose {

class EventLog;

/// What a socket lets its clients do.
enum class Access { read, control };

struct Request {
  std::string method;                        ///< "GET", "POST", "DELETE", …; HEAD comes as GET
  std::string path;                          ///< decoded, without the query: "/v1/jobs/7"; "*" of OPTIONS
  std::map<std::string, std::string> query;  ///< decoded
  std::string body;
  std::string content_type;      ///< the header of that name; empty if it is not there
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
  std::uint64_t after = 0;  ///< the last sequence number the client has seen
};

using Answer = std::variant<Response, EventStream>;

/// Requests of one lane wait for each other, those of different lanes never do. Reading has a lane for each
/// socket.
enum class Lane { read, command, stop };

/// What a server offers. Both calls are thread-safe and must not throw.
struct Application {
  /// Answers a request, on a thread of its lane; may block.
  std::function<Answer(const Request&)> answer;
  /// Called on the server's own thread: must be quick.
  std::function<Lane(const Request&)> lane;
};

/// A request that is refused before its route is looked up.
struct Refusal {
  int status = 400;
  std::string error;  ///< what happened
  std::string hint;   ///< what to do
};

/// {"error": …, "hint": …} with the status.
Response error_response(int status, const std::string& error, const std::string& hint);

/// How the bytes of an answer are framed.
struct Framing {
  bool http_1_0 = false;    ///< the client knows no chunks, and closes unless it asks for more
  bool keep_alive = false;  ///< the connection takes another request after this answer
  bool head_only = false;   ///< HEAD: the header that GET would get, without the body
};

/// The whole answer as bytes.
std::string message_text(const Response& response, const Framing& framing);

/// The header of an answer whose length is not known: chunks, or bytes until the connection closes.
std::string stream_header(std::string_view content_type, const Framing& framing);

}  // namespace eigenpose
