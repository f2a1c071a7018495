#pragma once

/// HTTP/1.1 on Unix sockets: reads requests within limits, has them answered, streams events.
///
/// One thread serves all clients. A malformed, slow or oversized request ends its own connection and nothing
/// else; a client that reads an event stream slowly loses old events and delays nobody.

#include <chrono>
#include <cstddef>
#include <memory>

#include "daemon/api/http.h"
#include "daemon/api/unix_socket.h"
#include "daemon/rig/heartbeat.h"

namespace eigenpose {

struct ServerOptions {
  int max_connections = 64;                           ///< on each socket; one more gets 503
  std::size_t max_header = 8192;                      ///< bytes; more gets 431
  std::size_t max_body = 65536;                       ///< bytes; more gets 413
  std::chrono::milliseconds request_timeout{10'000};  ///< to arrive, and for an answer to be taken
  std::chrono::milliseconds keep_alive{
      15'000};  ///< a comment on a silent stream, so that dead ones are noticed
};

/// The server. Made, told to listen, started; the destructor stops it. The calls here belong to one thread;
/// the handler runs on the server's own.
class Server {
 public:
  /// @param heartbeat hears that the server's thread turns; outlives the server.
  Server(const ServerOptions& options, Handler handler, Heartbeat& heartbeat);
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server();

  /// Accepts clients on `socket`, which must outlive the server. Before `start`.
  void listen(const UnixSocket& socket, Access access);
  void start();
  /// Wakes the event streams: call it after publishing. Thread-safe.
  void notify();
  /// Closes every connection and ends the thread. Idempotent.
  void stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
