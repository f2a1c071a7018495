#include "daemon/api/server.h"

// Boost 1.74's coroutines need std::exchange before them.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/api/admission.h"
#include "daemon/api/event_log.h"

namespace eigenpose {
namespace {

namespace asio = boost::asio;
using Protocol = asio::local::stream_protocol;
using boost::system::error_code;

auto capture(error_code& error) {
  return asio::redirect_error(asio::use_awaitable, error);
}

std::string sse_text(const EventLog::Event& event, const EventStream& stream) {
  std::string text;
  if (event.lost > 0) text += fmt::format("event: lost\ndata: {{\"lost\":{}}}\n\n", event.lost);
  // JSON holds no line break, so one data line is enough.
  text += fmt::format("id: {}-{}\nevent: {}\ndata: {}\n\n", stream.log->run(), event.sequence, event.name,
                      *event.data);
  return text;
}

std::string chunk(const std::string& text) {
  return fmt::format("{:x}\r\n{}\r\n", text.size(), text);
}

uid_t user_of(Protocol::socket& socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  const bool known = ::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;
  return known ? peer.uid : static_cast<uid_t>(-1);
}

/// One client. Its socket's operations end when a deadline passes. Lives on the server's thread.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  explicit Connection(Protocol::socket accepted)
      : socket(std::move(accepted)), deadline_(socket.get_executor()) {
    place.user = user_of(socket);
  }

  Protocol::socket socket;
  Place place;

  /// The operations under way and those to come fail once `timeout` from now is over.
  void expires_after(std::chrono::milliseconds timeout) {
    const std::uint64_t round = ++round_;
    expired_ = false;
    deadline_.expires_after(timeout);
    deadline_.async_wait([self = weak_from_this(), round](const error_code& error) {
      const auto connection = self.lock();
      if (error || !connection || connection->round_ != round) return;
      connection->expired_ = true;
      error_code ignored;
      connection->socket.cancel(ignored);
    });
  }
  void expires_never() {
    ++round_;
    deadline_.cancel();
  }
  /// Whether the deadline has passed; also when the operation that it was for was done at that moment.
  [[nodiscard]] bool expired() const { return expired_; }

  /// Ends everything at once, and gives the descriptor back.
  void drop() {
    expires_never();
    error_code ignored;
    socket.close(ignored);
  }

 private:
  asio::steady_timer deadline_;
  std::uint64_t round_ = 0;
  bool expired_ = false;
};

using ConnectionPointer = std::shared_ptr<Connection>;

/// A listening socket and its open connections.
struct Listener {
  std::optional<Protocol::acceptor> acceptor;
  Access access;
  std::size_t most;
  AdmissionPolicy admit;
  std::vector<ConnectionPointer> connections;
  std::uint64_t activity = 0;  ///< counts what clients do
  bool is_full = false;        ///< has been logged

  [[nodiscard]] std::size_t most_streams() const { return std::max<std::size_t>(1, most * 3 / 4); }

  /// Makes room for one more of that kind, if need be by dropping another. @return false when there is none.
  bool make_room(uid_t user, Place::Use use) {
    const bool for_stream = use == Place::Use::streaming;
    std::vector<Place> places;
    std::vector<ConnectionPointer> holders;
    for (const ConnectionPointer& connection : connections) {
      if (for_stream && connection->place.use != Place::Use::streaming) continue;
      places.push_back(connection->place);
      holders.push_back(connection);
    }
    const Admission admission = admit(places, for_stream ? most_streams() : most, user);
    if (admission.evicted) {
      holders[*admission.evicted]->drop();
      std::erase(connections, holders[*admission.evicted]);
    }
    if (admission.admitted != is_full) return admission.admitted;
    is_full = !admission.admitted;
    if (is_full)
      spdlog::warn("event=clients_turned_away socket={} connections={} most={}",
                   access == Access::read ? "results" : "control", places.size(), most);
    return admission.admitted;
  }
};

/// An entry in the listener's list of connections: while this lives, the connection is listed; then it is
/// closed.
class Membership {
 public:
  Membership(Listener& listener, ConnectionPointer connection)
      : listener_(&listener), connection_(std::move(connection)) {
    listener.connections.push_back(connection_);
  }
  Membership(Membership&&) noexcept = default;  // the other one holds nothing then
  Membership(const Membership&) = delete;
  Membership& operator=(const Membership&) = delete;
  Membership& operator=(Membership&&) = delete;
  ~Membership() {
    if (!connection_) return;
    std::erase(listener_->connections, connection_);
    connection_->drop();
  }
  [[nodiscard]] const ConnectionPointer& connection() const { return connection_; }

 private:
  Listener* listener_;
  ConnectionPointer connection_;
};

/// A timer in the set of those that a new event wakes, for as long as this lives.
class WokenByEvents {
 public:
  WokenByEvents(std::set<asio::steady_timer*>& sleeping, asio::steady_timer& timer)
      : sleeping_(sleeping), timer_(timer) {
    sleeping_.insert(&timer_);
  }
  WokenByEvents(const WokenByEvents&) = delete;
  WokenByEvents& operator=(const WokenByEvents&) = delete;
  ~WokenByEvents() { sleeping_.erase(&timer_); }

 private:
  std::set<asio::steady_timer*>& sleeping_;
  asio::steady_timer& timer_;
};

/// What becomes of an exception that ends a coroutine: it is logged, and ends nothing else.
auto logged(const char* event) {
  return [event](const std::exception_ptr& exception) {
    if (!exception) return;
    try {
      std::rethrow_exception(exception);
    } catch (const std::exception& error) {
      spdlog::error("event={} error=\"{}\"", event, error.what());
    } catch (...) {
      spdlog::error("event={} error=\"an exception of an unknown type\"", event);
    }
  };
}

/// After a failure of the whole server (no memory, no descriptor) and before the next attempt.
constexpr std::chrono::milliseconds pause_after_failure{100};

/// For a handler of exceptions, where nothing can be awaited: logs, and holds the thread up.
void pause_after(const char* event, const std::exception& error) {
  spdlog::error("event={} error=\"{}\"", event, error.what());
  std::this_thread::sleep_for(pause_after_failure);
}

void note_use(Listener& listener, Connection& connection, Place::Use use) {
  connection.place.use = use;
  connection.place.since = ++listener.activity;
}

/// Answers 503 without waiting for anything.
void turn_away(Protocol::socket socket, std::size_t most) {
  const Response busy = error_response(503, fmt::format("too many clients: {}", most),
                                       "close one, or raise max_connections in [api]");
  const std::string text = message_text(busy, Framing{});
  const int descriptor = socket.native_handle();
  (void)!::send(descriptor, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  // What is left unread would reset the connection before the answer is read.
  std::array<char, 4096> unread{};
  for (int i = 0; i < 16 && ::recv(descriptor, unread.data(), unread.size(), MSG_DONTWAIT) > 0; ++i) {
  }
}

}  // namespace

struct Server::Impl {
  ServerOptions options;
  Application application;
  std::function<void()> beat;
  std::set<asio::steady_timer*> sleeping_streams;  ///< touched on the server's thread only
  std::vector<std::unique_ptr<Listener>> listeners;
  std::unique_ptr<asio::io_context> io = std::make_unique<asio::io_context>(1);
  std::thread thread;
  asio::thread_pool stops{1};
  asio::thread_pool commands{1};
  asio::thread_pool operator_reads{1};
  asio::thread_pool public_reads{2};

  /// Shows that the thread turns. An exception loses one beat and not those to come.
  asio::awaitable<void> beat_on() {
    asio::steady_timer timer(*io);
    error_code error;
    while (!error) {
      try {
        beat();
        timer.expires_after(options.beat_period);
        co_await timer.async_wait(capture(error));
      } catch (const std::exception& failure) {
        pause_after("beat_failed", failure);
      }
    }
  }

  /// An exception loses one client and not those to come.
  asio::awaitable<void> accept_all(Listener& listener) {
    for (;;) {
      try {
        error_code error;
        Protocol::socket socket(*io);
        co_await listener.acceptor->async_accept(socket, capture(error));
        if (error == asio::error::operation_aborted) co_return;
        if (!error) {
          take_in(std::move(socket), listener);
          continue;
        }
        spdlog::warn("event=accept_failed error=\"{}\"", error.message());
        asio::steady_timer pause(*io, pause_after_failure);
        co_await pause.async_wait(capture(error));
      } catch (const std::exception& failure) {
        pause_after("accept_failed", failure);
      }
    }
  }

  void take_in(Protocol::socket socket, Listener& listener) {
    if (!listener.make_room(user_of(socket), Place::Use::idle)) {
      turn_away(std::move(socket), listener.most);
      return;
    }
    auto connection = std::make_shared<Connection>(std::move(socket));
    note_use(listener, *connection, Place::Use::idle);
    asio::co_spawn(*io, serve(Membership(listener, std::move(connection)), listener),
                   logged("connection_failed"));
  }

  // GCC 12 destroys some temporaries of a co_await expression twice: what is awaited takes references to
  // named values, which outlive it.

  /// Lets an answer still under way arrive, which bytes that nobody read would cut off.
  asio::awaitable<void> close(Connection& connection) {
    error_code error;
    connection.socket.shutdown(Protocol::socket::shutdown_send, error);
    std::array<char, 4096> rest{};
    connection.expires_after(std::chrono::seconds(1));
    for (int piece = 0; !error && piece < 64; ++piece)
      co_await connection.socket.async_read_some(asio::buffer(rest), capture(error));
    connection.expires_never();
  }

  /// @return false when the client has left or takes nothing.
  asio::awaitable<bool> send(Connection& connection, const std::string& text) {
    error_code error;
    connection.expires_after(options.request_timeout);
    co_await asio::async_write(connection.socket, asio::buffer(text), capture(error));
    co_return !error && !connection.expired();
  }

  /// Sends an answer after which the connection is closed.
  asio::awaitable<void> send_last(Connection& connection, const Response& response) {
    const std::string text = message_text(response, Framing{});
    const bool sent = co_await send(connection, text);
    if (sent) co_await close(connection);
  }

  /// Reads until a request is complete or refused. @return false when the client left, was dropped, or let
  /// the time for beginning a request pass.
  asio::awaitable<bool> read_request(Connection& connection, Listener& listener, RequestReader& reader) {
    static const std::string go_on = "HTTP/1.1 100 Continue\r\n\r\n";
    std::array<char, 16384> bytes{};
    connection.expires_after(options.request_timeout);
    bool begun = reader.has_begun();
    for (;;) {
      const RequestReader::State state = reader.state();
      if (state == RequestReader::State::complete || state == RequestReader::State::refused) co_return true;
      if (state == RequestReader::State::needs_continue) {
        const bool sent = co_await send(connection, go_on);
        if (!sent) co_return false;
        reader.go_on();
        continue;
      }
      error_code error;
      const std::size_t count =
          co_await connection.socket.async_read_some(asio::buffer(bytes), capture(error));
      if (error || connection.expired()) {
        if (reader.has_begun()) co_await refuse_unfinished(connection);
        co_return false;
      }
      reader.feed({bytes.data(), count});
      if (!begun && reader.has_begun()) {
        begun = true;
        note_use(listener, connection, Place::Use::busy);
        connection.expires_after(options.request_timeout);
      }
    }
  }

  /// The client has left its request unfinished.
  asio::awaitable<void> refuse_unfinished(Connection& connection) {
    if (!connection.socket.is_open()) co_return;
    const Response refused =
        connection.expired()
            ? error_response(
                  408,
                  fmt::format("the request did not arrive within {} ms", options.request_timeout.count()),
                  "send it at once, or raise request_timeout_ms in [api]")
            : error_response(400, "the request ended before it was complete", "send all of it");
    co_await send_last(connection, refused);
  }

  /// @param member ends with the coroutine, also where that never begins.
  asio::awaitable<void> serve(Membership member, Listener& listener) {
    const ConnectionPointer& connection = member.connection();
    RequestReader reader(options.limits);
    for (bool keep_alive = true; keep_alive;) {
      note_use(listener, *connection, reader.has_begun() ? Place::Use::busy : Place::Use::idle);
      const bool read = co_await read_request(*connection, listener, reader);
      if (!read) co_return;
      note_use(listener, *connection, Place::Use::busy);
      if (reader.state() == RequestReader::State::refused) {
        const Refusal& refusal = reader.refusal();
        const Response refused = error_response(refusal.status, refusal.error, refusal.hint);
        co_await send_last(*connection, refused);
        co_return;
      }
      RequestReader::Taken taken = reader.take();
      taken.request.access = listener.access;
      connection->expires_never();
      Answer answer = co_await answer_on_its_lane(taken.request);
      const auto* events = std::get_if<EventStream>(&answer);
      const bool streams = events != nullptr && !taken.framing.head_only;
      if (streams && listener.make_room(connection->place.user, Place::Use::streaming)) {
        co_await stream_events(connection, listener, *events, taken.framing);
        co_return;
      }
      const std::string text = answer_text(answer, taken.framing, listener);
      keep_alive = taken.framing.keep_alive;
      const bool sent = co_await send(*connection, text);
      if (!sent) co_return;
    }
    note_use(listener, *connection, Place::Use::idle);
    co_await close(*connection);
  }

  /// The bytes of an answer that is no stream: of HEAD, or of a stream for which there is no place.
  static std::string answer_text(const Answer& answer, const Framing& framing, const Listener& listener) {
    if (const auto* response = std::get_if<Response>(&answer)) return message_text(*response, framing);
    if (framing.head_only) return stream_header("text/event-stream", framing);
    return message_text(
        error_response(503, fmt::format("too many event streams: {}", listener.most_streams()),
                       "close one, ask for /v1/results/latest, or raise max_connections in [api]"),
        framing);
  }

  asio::thread_pool& lane_of(const Request& request) {
    switch (application.lane(request)) {
      case Lane::stop:
        return stops;
      case Lane::command:
        return commands;
      case Lane::read:
        break;
    }
    return request.access == Access::control ? operator_reads : public_reads;
  }

  asio::awaitable<Answer> answer_on_its_lane(const Request& request) {
    const auto answer = std::make_shared<Answer>(
        error_response(500, "eigenposed failed to answer", "its log says why; please report it"));
    const auto answered = std::make_shared<asio::steady_timer>(*io, asio::steady_timer::time_point::max());
    // A copy: when the server stops, the lane may still be answering while the caller is gone.
    asio::post(lane_of(request), [this, answer, answered, asked = std::make_shared<const Request>(request)] {
      try {
        *answer = application.answer(*asked);
      } catch (...) {
        logged("request_failed")(std::current_exception());
      }
      end_wait(answered);
    });
    error_code cancelled;
    co_await answered->async_wait(capture(cancelled));
    co_return *answer;
  }

  /// Ends a wait of the server's thread, from a lane.
  void end_wait(const std::shared_ptr<asio::steady_timer>& timer) {
    for (;;) {
      try {
        // The wait has begun by then: this runs after what the server's thread is doing now.
        asio::post(*io, [timer] { timer->cancel(); });
        return;
      } catch (const std::exception& failure) {
        pause_after("request_failed", failure);
      }
    }
  }

  asio::awaitable<void> stream_events(ConnectionPointer connection, Listener& listener,
                                      const EventStream& events, Framing framing) {
    note_use(listener, *connection, Place::Use::streaming);
    framing.keep_alive = false;
    const std::string header = stream_header("text/event-stream", framing);
    const bool sent = co_await send(*connection, header);
    if (!sent) co_return;
    auto wake = std::make_shared<asio::steady_timer>(*io);
    auto gone = std::make_shared<bool>(false);
    connection->expires_never();
    asio::co_spawn(*io, watch_for_disconnect(connection, wake, gone), logged("connection_failed"));
    std::uint64_t seen = events.after;
    error_code error;
    while (!*gone) {
      std::string text;
      if (const auto event = events.log->after(seen)) {
        text = sse_text(*event, events);
        seen = event->sequence;
      } else {
        wake->expires_after(options.keep_alive);
        const WokenByEvents woken(sleeping_streams, *wake);
        co_await wake->async_wait(capture(error));
        if (*gone) break;
        if (error) continue;  // woken by a new event
        text = ": still here\n\n";
      }
      if (!framing.http_1_0) text = chunk(text);
      // A slow reader may take its time, but one that takes nothing at all for this long is dead.
      connection->expires_after(options.stream_timeout);
      co_await asio::async_write(connection->socket, asio::buffer(text), capture(error));
      if (error || connection->expired()) break;
      connection->expires_never();
      note_use(listener, *connection, Place::Use::streaming);
    }
    connection->drop();
  }

  /// Reads (and ignores) what the client of a stream sends, to notice when it disconnects.
  asio::awaitable<void> watch_for_disconnect(ConnectionPointer connection,
                                             std::shared_ptr<asio::steady_timer> wake,
                                             std::shared_ptr<bool> gone) {
    std::array<char, 512> ignored{};
    error_code error;
    while (!error) co_await connection->socket.async_read_some(asio::buffer(ignored), capture(error));
    *gone = true;
    wake->cancel();
  }
};

Server::Server(const ServerOptions& options, Application application, std::function<void()> beat)
    : impl_(std::make_unique<Impl>()) {
  impl_->beat = std::move(beat);
  impl_->options = options;
  impl_->application = std::move(application);
}

Server::~Server() {
  stop();
}

void Server::listen(const UnixSocket& socket, Access access, int most) {
  const int descriptor = ::fcntl(socket.descriptor(), F_DUPFD_CLOEXEC, 0);
  Protocol::acceptor acceptor(*impl_->io, Protocol(), descriptor);
  impl_->listeners.push_back(
      std::unique_ptr<Listener>(new Listener{std::move(acceptor),
                                             access,
                                             static_cast<std::size_t>(std::max(1, most)),
                                             impl_->options.admit,
                                             {},
                                             0,
                                             false}));
}

void Server::start() {
  if (impl_->beat) asio::co_spawn(*impl_->io, impl_->beat_on(), logged("beat_failed"));
  for (const auto& listener : impl_->listeners)
    asio::co_spawn(*impl_->io, impl_->accept_all(*listener), logged("accept_failed"));
  impl_->thread = std::thread([this] {
    for (;;) {
      try {
        impl_->io->run();
        return;
      } catch (const std::exception& error) {
        // A failure of one connection must not end the service for the others.
        spdlog::error("event=connection_failed error=\"{}\"", error.what());
      }
    }
  });
}

void Server::notify() {
  asio::post(*impl_->io, [impl = impl_.get()] {
    for (asio::steady_timer* timer : impl->sleeping_streams) timer->cancel();
  });
}

void Server::stop() {
  if (!impl_->io) return;
  impl_->io->stop();
  if (impl_->thread.joinable()) impl_->thread.join();
  for (asio::thread_pool* lane :
       {&impl_->stops, &impl_->commands, &impl_->operator_reads, &impl_->public_reads}) {
    lane->stop();
    lane->join();
  }
  // The coroutines that are left end with their io_context, and use the listeners' lists until then.
  for (const auto& listener : impl_->listeners) {
    listener->acceptor.reset();
    listener->connections.clear();
  }
  impl_->io.reset();
}

}  // namespace eigenpose
