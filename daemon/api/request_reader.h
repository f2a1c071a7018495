#pragma once

/// Reads HTTP/1.1 requests out of a connection's bytes, strictly by RFC 9112.
///
/// Beast parses; what it lets pass and the RFC forbids or leaves to the server is refused here: bare line
/// feeds and carriage returns, folded lines, white space before a colon, control characters, several or bad
/// lengths, a length beside a transfer coding, no Host or two.

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/api/http.h"

namespace eigenpose {

struct RequestLimits {
  std::size_t max_header = 8192;  ///< bytes of request line and fields; more gets 431, or 414
  std::size_t max_body = 65536;   ///< bytes; more gets 413
};

/// Fed with bytes, gives one request after the other. No thread or clock of its own; one thread at a time.
class RequestReader {
 public:
  explicit RequestReader(const RequestLimits& limits);
  RequestReader(const RequestReader&) = delete;
  RequestReader& operator=(const RequestReader&) = delete;
  ~RequestReader();

  enum class State {
    needs_more,      ///< feed it
    needs_continue,  ///< the client waits for "100 Continue" before it sends the body: send it, `go_on`
    complete,        ///< `take` the request
    refused,         ///< answer `refusal`, then close the connection: what follows is not understood
  };

  State feed(std::string_view bytes);
  State go_on();
  [[nodiscard]] State state() const { return state_; }
  /// Whether a part of a request has come.
  [[nodiscard]] bool has_begun() const;

  /// The request. @pre state() is complete. The reader goes on with the bytes that came behind it.
  struct Taken {
    Request request;
    Framing framing;  ///< of its answer
  };
  Taken take();
  /// @pre state() is refused.
  [[nodiscard]] const Refusal& refusal() const { return refusal_; }

 private:
  struct Body;
  State advance();
  bool find_head();
  void open_body(std::string_view head);
  void read_body();
  bool accept_fields();
  bool accept_length();
  void refuse(int status, std::string error, std::string hint);

  RequestLimits limits_;
  State state_ = State::needs_more;
  std::string bytes_;           ///< come and not yet used
  std::size_t scanned_ = 0;     ///< of bytes_, while the header is incomplete
  std::unique_ptr<Body> body_;  ///< once the header is complete
  Taken next_;
  Refusal refusal_;
};

}  // namespace eigenpose
