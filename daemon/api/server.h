#pragma once

/// HTTP/1.1 on Unix sockets: reads requests within limits, has them answered, streams events.
///
/// One thread serves all connections and only moves bytes. Requests are answered on other threads, a few for
/// each lane, so that what readers ask for never delays a command, and nothing delays a stop. A malformed,
/// slow or oversized request ends its own connection and nothing else; a client that reads an event stream
/// slowly loses old events and delays nobody.

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

#include "daemon/api/admission.h"
#include "daemon/api/http.h"
#include "daemon/api/request_reader.h"
#include "daemon/api/unix_socket.h"

namespace eigenpose {

struct ServerOptions {
  RequestLimits limits;
  /// For a request to arrive once it has begun, for the next one to begin, and for an answer to be taken.
  std::chrono::milliseconds request_timeout{10'000};
  /// A stream whose client takes nothing for so long is closed.
  std::chrono::milliseconds stream_timeout{60'000};
  /// A comment on a silent stream, so that dead ones are noticed.
  std::chrono::milliseconds keep_alive{15'000};
  std::chrono::milliseconds beat_period{1'000};
  AdmissionPolicy admit = eigenpose::admit;  ///< called on the server's thread
};

/// The server. Made, told to listen, started; the destructor stops it. The calls here belong to one thread.
class Server {
 public:
  /// @param beat is called on the server's thread every `beat_period`, as long as nothing holds it up; may be
  /// empty.
  Server(const ServerOptions& options, Application application, std::function<void()> beat = {});
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server();

  /// Accepts clients on `socket`, which must outlive the server. Before `start`.
  /// @param most connections at once, ≥ 1; of these three quarters may be event streams. When there are more,
  /// `ServerOptions::admit` says which one is closed; a client that is refused gets 503 and costs nothing
  /// that lasts.
  void listen(const UnixSocket& socket, Access access, int most);
  void start();
  /// Wakes the event streams: call it after publishing. Thread-safe.
  void notify();
  /// Closes every connection and ends the threads, after the requests being answered. Idempotent.
  void stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
