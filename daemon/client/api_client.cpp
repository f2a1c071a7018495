#include "daemon/client/api_client.h"

// Boost 1.74's Asio needs std::exchange before it.
#include <array>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"

namespace eigenpose {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Protocol = asio::local::stream_protocol;
using Stream = beast::basic_stream<Protocol>;
using beast::error_code;
using nlohmann::json;

/// Pictures are the largest answers.
constexpr std::uint64_t largest_answer = 256U << 20U;

/// A connection whose every step has a deadline.
class Connection {
 public:
  Connection(const std::filesystem::path& socket, std::chrono::milliseconds timeout)
      : socket_(socket), timeout_(timeout), stream_(io_) {
    // The kernel takes or refuses a local connection at once.
    error_code error;
    stream_.socket().connect(Protocol::endpoint(socket.string()), error);
    if (error == asio::error::access_denied)
      throw FileError(
          socket,
          "you may not use this socket: join the group that owns it, or use results.sock for reading");
    if (error)
      throw FileError(socket, "no eigenposed answers there (" + error.message() +
                                  "): start it, or name its socket with --socket");
  }

  void send(std::string_view method, std::string_view target, const std::string& body) {
    http::request<http::string_body> request(http::string_to_verb({method.data(), method.size()}),
                                             {target.data(), target.size()}, 11);
    request.set(http::field::host, "eigenpose");
    request.set(http::field::user_agent, "eigenpose");
    if (!body.empty()) {
      request.set(http::field::content_type, "application/json");
      request.body() = body;
    }
    request.prepare_payload();
    error_code result;
    start();
    http::async_write(stream_, request, [&](const error_code& error, std::size_t) { result = error; });
    run();
    // A server that has had enough may answer before it has read all.
    if (result && result != asio::error::broken_pipe && result != asio::error::connection_reset) fail(result);
  }

  template <typename Parser>
  void read_header(Parser& parser) {
    step(parser, [&](auto handler) { http::async_read_header(stream_, buffer_, parser, handler); });
  }

  template <typename Parser>
  void read_rest(Parser& parser) {
    step(parser, [&](auto handler) { http::async_read(stream_, buffer_, parser, handler); });
  }

  /// Reads what there is of a body without end. @return false when the service has ended it or `stop` was
  /// requested.
  template <typename Parser>
  bool read_some(Parser& parser, const std::stop_token& stop) {
    error_code result;
    stream_.expires_never();
    http::async_read_some(stream_, buffer_, parser,
                          [&](const error_code& error, std::size_t) { result = error; });
    const std::stop_callback interrupt(stop, [this] { asio::post(io_, [this] { stream_.cancel(); }); });
    run();
    return !result || result == http::error::need_buffer;
  }

 private:
  void start() { stream_.expires_after(timeout_); }
  void run() {
    io_.restart();
    io_.run();
  }

  template <typename Parser, typename Start>
  void step(Parser&, Start begin) {
    error_code result;
    start();
    begin([&](const error_code& error, std::size_t) { result = error; });
    run();
    if (result && result != http::error::end_of_stream) fail(result);
    if (result) throw Error(socket_.string() + ": eigenposed closed the connection without an answer");
  }

  [[noreturn]] void fail(const error_code& error) const {
    if (error == beast::error::timeout)
      throw Error(socket_.string() + ": no answer within " + std::to_string(timeout_.count()) +
                  " ms: the log of eigenposed may say why");
    throw Error(socket_.string() + ": the connection broke: " + error.message());
  }

  const std::filesystem::path& socket_;
  std::chrono::milliseconds timeout_;
  asio::io_context io_{1};
  Stream stream_;
  beast::flat_buffer buffer_;
};

[[noreturn]] void refuse(int status, const std::string& body) {
  const json answer = json::parse(body, nullptr, false);
  if (!answer.is_object()) throw ApiError(status, "HTTP status " + std::to_string(status), "");
  const auto text = [&](const char* key) {
    const auto found = answer.find(key);
    return found != answer.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  throw ApiError(status, text("error"), text("hint"));
}

std::string text_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

ApiError::ApiError(int status, const std::string& error, const std::string& hint)
    : Error(hint.empty() ? error : error + ": " + hint), status_(status) {}

ApiClient::ApiClient(std::filesystem::path socket, std::chrono::milliseconds timeout)
    : socket_(std::move(socket)), timeout_(timeout) {}

json ApiClient::get(std::string_view target) const {
  return ask_json("GET", target, "");
}

json ApiClient::post(std::string_view target, const json& body) const {
  return ask_json("POST", target, body.empty() ? "" : body.dump());
}

json ApiClient::remove(std::string_view target) const {
  return ask_json("DELETE", target, "");
}

std::string ApiClient::get_bytes(std::string_view target) const {
  return ask("GET", target, "").body;
}

ApiClient::Reply ApiClient::ask(std::string_view method, std::string_view target,
                                const std::string& body) const {
  Connection connection(socket_, timeout_);
  connection.send(method, target, body);
  http::response_parser<http::string_body> parser;
  parser.body_limit(largest_answer);
  connection.read_rest(parser);
  Reply reply{static_cast<int>(parser.get().result_int()), std::move(parser.get().body())};
  if (reply.status >= 400) refuse(reply.status, reply.body);
  return reply;
}

json ApiClient::ask_json(std::string_view method, std::string_view target, const std::string& body) const {
  const Reply reply = ask(method, target, body);
  json answer = json::parse(reply.body, nullptr, false);
  if (answer.is_discarded())
    throw Error(socket_.string() + ": the answer is not JSON: is this eigenposed's socket?");
  return answer;
}

void ApiClient::follow(std::string_view target, const std::function<bool(const ApiEvent&)>& handle,
                       std::stop_token stop) const {
  Connection connection(socket_, timeout_);
  connection.send("GET", target, "");
  http::response_parser<http::buffer_body> parser;
  parser.body_limit(boost::none);
  connection.read_header(parser);
  std::array<char, 16384> bytes{};
  if (parser.get().result_int() >= 400) {
    std::string body;
    do {
      parser.get().body() = {bytes.data(), bytes.size(), true};
      if (!connection.read_some(parser, stop)) break;
      body.append(bytes.data(), bytes.size() - parser.get().body().size);
    } while (!parser.is_done());
    refuse(static_cast<int>(parser.get().result_int()), body);
  }
  EventParser events;
  while (!parser.is_done() && !stop.stop_requested()) {
    parser.get().body() = {bytes.data(), bytes.size(), true};
    const bool open = connection.read_some(parser, stop);
    if (!events.feed({bytes.data(), bytes.size() - parser.get().body().size}, handle)) return;
    if (!open) return;
  }
}

json ApiClient::wait_for_job(const std::string& id, const Progress& progress, std::stop_token stop) const {
  constexpr std::chrono::milliseconds period{100};
  const SteadyClock clock;
  for (;;) {
    json job = get("/v1/jobs/" + id);
    const std::string state = text_of(job, "state");
    if (state == "done") return job;
    if (state != "running") throw ApiError(409, text_of(job, "error"), text_of(job, "hint"));
    const std::string stage = text_of(job, "stage");
    if (progress && !stage.empty())
      progress({stage, job.value("done", std::size_t{0}), job.value("total", std::size_t{0})});
    if (!clock.sleep_for(period, stop)) {
      remove("/v1/jobs/" + id);
      throw Interrupted("job " + id + " is cancelled; what was done is kept");
    }
  }
}

}  // namespace eigenpose
