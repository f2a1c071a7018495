#include "daemon/api/server.h"

// Boost 1.74's coroutines need std::exchange before them.
#include <cstdlib>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/api/errors.h"
#include "daemon/api/event_log.h"
#include "daemon/api/target.h"

namespace eigenpose {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Protocol = asio::local::stream_protocol;
using Stream = beast::basic_stream<Protocol>;
using Message = http::response<http::string_body>;
using beast::error_code;

auto capture(error_code& error) {
  return asio::redirect_error(asio::use_awaitable, error);
}

Message to_message(Response response, unsigned version, bool keep_alive) {
  Message message(http::int_to_status(static_cast<unsigned>(response.status)), version);
  message.set(http::field::server, "eigenposed");
  message.set(http::field::content_type, response.content_type);
  message.set(http::field::cache_control, "no-store");
  for (const auto& [name, value] : response.headers) message.set(name, value);
  message.body() = std::move(response.body);
  message.keep_alive(keep_alive);
  message.prepare_payload();
  return message;
}

/// What to tell a client whose request could not be read.
Response refusal(const error_code& error, const ServerOptions& options) {
  if (error == http::error::body_limit)
    return error_response(413,
                          "the request's body is larger than " + std::to_string(options.max_body) + " bytes",
                          "send less, or raise max_body_kib in [api]");
  if (error == http::error::header_limit || error == http::error::buffer_overflow)
    return error_response(
        431, "the request's header is larger than " + std::to_string(options.max_header) + " bytes",
        "send fewer or shorter headers");
  return error_response(400, "not a valid HTTP request: " + error.message(), "speak HTTP/1.1");
}

std::string sse_text(const EventLog::Event& event, const std::string& name) {
  std::string text;
  if (event.lost > 0) text += "event: lost\ndata: {\"lost\":" + std::to_string(event.lost) + "}\n\n";
  // JSON holds no line break, so one data line is enough.
  text += "id: " + std::to_string(event.sequence) + "\nevent: " + name + "\ndata: " + *event.data + "\n\n";
  return text;
}

/// Counts one up while it lives.
class Occupied {
 public:
  explicit Occupied(int& count) : count_(&count) { ++*count_; }
  Occupied(const Occupied&) = delete;
  Occupied& operator=(const Occupied&) = delete;
  ~Occupied() { --*count_; }

 private:
  int* count_;
};

}  // namespace

struct Server::Impl {
  /// One socket's acceptor and how many clients it has.
  struct Door {
    std::optional<Protocol::acceptor> acceptor;
    Access access;
    int clients = 0;
  };

  ServerOptions options;
  Handler handler;
  std::set<asio::steady_timer*> sleeping_streams;  ///< touched on the server's thread only
  std::vector<std::unique_ptr<Door>> doors;
  Heartbeat::Pulse pulse;  ///< beaten on the server's thread
  std::unique_ptr<asio::io_context> io = std::make_unique<asio::io_context>(1);
  std::thread thread;

  /// Reports that the thread turns, as long as no handler holds it up.
  asio::awaitable<void> beat() {
    asio::steady_timer timer(*io);
    error_code error;
    while (!error) {
      pulse.beat();
      timer.expires_after(std::chrono::seconds(1));
      co_await timer.async_wait(capture(error));
    }
  }

  asio::awaitable<void> accept_all(Door& door) {
    for (;;) {
      error_code error;
      Protocol::socket socket(*io);
      co_await door.acceptor->async_accept(socket, capture(error));
      if (error == asio::error::operation_aborted) co_return;
      if (error) {
        // Out of descriptors: clients that leave give some back.
        spdlog::warn("event=accept_failed error=\"{}\"", error.message());
        asio::steady_timer pause(*io, std::chrono::milliseconds(100));
        co_await pause.async_wait(capture(error));
        continue;
      }
      auto stream = std::make_shared<Stream>(std::move(socket));
      if (door.clients >= options.max_connections)
        asio::co_spawn(*io, turn_away(std::move(stream)), asio::detached);
      else
        asio::co_spawn(*io, serve(std::move(stream), door), asio::detached);
    }
  }

  asio::awaitable<void> turn_away(std::shared_ptr<Stream> stream) {
    const Response busy = error_response(503, "too many clients: " + std::to_string(options.max_connections),
                                         "close one, or raise max_connections in [api]");
    Message message = to_message(busy, 11, false);
    error_code error;
    stream->expires_after(std::chrono::seconds(1));
    co_await http::async_write(*stream, message, capture(error));
    co_await close(*stream);
  }

  /// Says good-bye so that an answer still under way is not cut off by bytes nobody read.
  asio::awaitable<void> close(Stream& stream) {
    error_code error;
    stream.socket().shutdown(Protocol::socket::shutdown_send, error);
    std::array<char, 4096> rest{};
    stream.expires_after(std::chrono::seconds(1));
    for (int chunk = 0; !error && chunk < 64; ++chunk)
      co_await stream.async_read_some(asio::buffer(rest), capture(error));
  }

  asio::awaitable<void> serve(std::shared_ptr<Stream> stream, Door& door) {
    const Occupied occupied(door.clients);
    beast::flat_buffer buffer(options.max_header + options.max_body);
    for (bool keep_alive = true; keep_alive;) {
      http::request_parser<http::string_body> parser;
      parser.header_limit(static_cast<std::uint32_t>(options.max_header));
      parser.body_limit(options.max_body);
      error_code error;
      stream->expires_after(options.request_timeout);
      co_await http::async_read(*stream, buffer, parser, capture(error));
      if (error == http::error::end_of_stream || error == beast::error::timeout) co_return;
      if (error) {
        if (error.category() != make_error_code(http::error::bad_method).category()) co_return;
        Message message = to_message(refusal(error, options), 11, false);
        stream->expires_after(options.request_timeout);
        co_await http::async_write(*stream, message, capture(error));
        break;
      }
      const auto& request = parser.get();
      keep_alive = request.keep_alive();
      Answer answer = answer_to(request, door.access);
      if (auto* events = std::get_if<EventStream>(&answer)) {
        co_await stream_events(stream, std::move(*events), request.version());
        co_return;
      }
      Response& response = std::get<Response>(answer);
      if (request.method() == http::verb::head) response.body.clear();
      Message message = to_message(std::move(response), request.version(), keep_alive);
      stream->expires_after(options.request_timeout);
      co_await http::async_write(*stream, message, capture(error));
      if (error) co_return;
    }
    co_await close(*stream);
  }

  Answer answer_to(const http::request<http::string_body>& request, Access access) {
    Request plain;
    plain.method = std::string(request.method_string());
    if (plain.method == "HEAD") plain.method = "GET";
    if (!split_target(std::string(request.target()), plain.path, plain.query))
      return error_response(400, "the request's target is not understood",
                            "ask for a path such as /v1/status");
    plain.body = request.body();
    plain.last_event_id = std::string(request["Last-Event-ID"]);
    plain.access = access;
    return handler(plain);
  }

  asio::awaitable<void> stream_events(std::shared_ptr<Stream> stream, EventStream events, unsigned version) {
    http::response<http::empty_body> head(http::status::ok, version);
    head.set(http::field::server, "eigenposed");
    head.set(http::field::content_type, "text/event-stream");
    head.set(http::field::cache_control, "no-store");
    head.chunked(true);
    http::response_serializer<http::empty_body> serializer(head);
    error_code error;
    stream->expires_after(options.request_timeout);
    co_await http::async_write_header(*stream, serializer, capture(error));
    if (error) co_return;

    auto wake = std::make_shared<asio::steady_timer>(*io);
    auto gone = std::make_shared<bool>(false);
    stream->expires_never();
    asio::co_spawn(*io, watch_for_leaving(stream, wake, gone), asio::detached);
    while (!*gone) {
      std::string text;
      if (const auto event = events.log->after(events.after)) {
        text = sse_text(*event, events.event);
        events.after = event->sequence;
      } else {
        wake->expires_after(options.keep_alive);
        sleeping_streams.insert(wake.get());
        co_await wake->async_wait(capture(error));
        sleeping_streams.erase(wake.get());
        if (*gone) break;
        if (error) continue;  // woken by a new event
        text = ": still here\n\n";
      }
      // A slow reader may take its time, but one that takes nothing at all for this long is dead.
      stream->expires_after(options.request_timeout * 6);
      co_await asio::async_write(*stream, http::make_chunk(asio::buffer(text)), capture(error));
      if (error) break;
    }
    stream->cancel();
  }

  /// Reads (and ignores) what the client of a stream sends, to notice when it leaves.
  asio::awaitable<void> watch_for_leaving(std::shared_ptr<Stream> stream,
                                          std::shared_ptr<asio::steady_timer> wake,
                                          std::shared_ptr<bool> gone) {
    std::array<char, 512> ignored{};
    error_code error;
    while (!error) co_await stream->async_read_some(asio::buffer(ignored), capture(error));
    *gone = true;
    wake->cancel();
  }
};

Server::Server(const ServerOptions& options, Handler handler, Heartbeat& heartbeat)
    : impl_(std::make_unique<Impl>()) {
  impl_->pulse = heartbeat.join("server", std::chrono::seconds(15));
  impl_->options = options;
  impl_->handler = std::move(handler);
}

Server::~Server() {
  stop();
}

void Server::listen(const UnixSocket& socket, Access access) {
  const int descriptor = ::dup(socket.descriptor());
  Protocol::acceptor acceptor(*impl_->io, Protocol(), descriptor);
  impl_->doors.push_back(std::unique_ptr<Impl::Door>(new Impl::Door{std::move(acceptor), access}));
}

void Server::start() {
  asio::co_spawn(*impl_->io, impl_->beat(), asio::detached);
  for (const auto& door : impl_->doors) asio::co_spawn(*impl_->io, impl_->accept_all(*door), asio::detached);
  impl_->thread = std::thread([this] {
    for (;;) {
      try {
        impl_->io->run();
        return;
      } catch (const std::exception& error) {
        // One client's trouble must not end the service for the others.
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
  // Acceptors need their io_context to go; what the connections count, in turn, outlives them.
  for (const auto& door : impl_->doors) door->acceptor.reset();
  impl_->io.reset();
}

}  // namespace eigenpose
