#include "daemon/api/client/api_client.h"

#include <array>
#include <chrono>
#include <utility>

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "daemon/api/client/local_stream.h"

namespace eigenpose {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;
using beast::error_code;
using nlohmann::json;

/// Pictures are the largest answers.
constexpr std::uint64_t largest_answer = 256U << 20U;

/// A connection whose every step has a deadline.
class Connection {
 public:
  Connection(const std::filesystem::path& socket, std::chrono::milliseconds timeout)
      : socket_(socket), timeout_(timeout), stream_(socket) {}

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
    error_code error;
    stream_.expires_after(timeout_);
    http::write(stream_, request, error);
    // A server that has had enough may answer before it has read all.
    if (error && error != boost::system::errc::broken_pipe && error != boost::system::errc::connection_reset)
      fail(error);
  }

  template <typename Parser>
  void read_header(Parser& parser) {
    error_code error;
    stream_.expires_after(timeout_);
    http::read_header(stream_, buffer_, parser, error);
    check_answer(error);
  }

  template <typename Parser>
  void read_rest(Parser& parser) {
    error_code error;
    stream_.expires_after(timeout_);
    http::read(stream_, buffer_, parser, error);
    check_answer(error);
  }

  /// Reads what there is of a body without end. @return false when the service has ended it or `stop` was
  /// requested.
  template <typename Parser>
  bool read_some(Parser& parser, const std::stop_token& stop) {
    error_code error;
    stream_.expires_never();
    const std::stop_callback interrupt(stop, [this] { stream_.cancel(); });
    http::read_some(stream_, buffer_, parser, error);
    return !error || error == http::error::need_buffer;
  }

 private:
  void check_answer(const error_code& error) const {
    if (error == http::error::end_of_stream)
      throw Error(socket_.string() + ": eigenposed closed the connection without an answer");
    if (error) fail(error);
  }

  [[noreturn]] void fail(const error_code& error) const {
    if (error == boost::system::errc::timed_out)
      throw Error(socket_.string() + ": no answer within " + std::to_string(timeout_.count()) +
                  " ms; the log of eigenposed may say why");
    throw Error(socket_.string() + ": the connection broke: " + error.message());
  }

  const std::filesystem::path& socket_;
  std::chrono::milliseconds timeout_;
  LocalStream stream_;
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
    : Error(hint.empty() ? error : error + "; " + hint), status_(status) {}

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
    throw Error(socket_.string() + ": the answer is not JSON; give the path of eigenposed's socket");
  return answer;
}

void ApiClient::follow(std::string_view target, const std::function<bool(const ApiEvent&)>& handle,
                       const std::stop_token& stop) const {
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

json ApiClient::wait_for_job(const std::string& id, const Progress& progress,
                             const std::stop_token& stop) const {
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
    if (clock.sleep_for(period, stop)) continue;
    try {
      remove("/v1/jobs/" + id);
    } catch (const ApiError& error) {
      if (error.status() == 409) continue;  // it has ended meanwhile: how, the next look says
      throw;
    }
    throw Interrupted("job " + id + " is cancelled; what was done is kept");
  }
}

}  // namespace eigenpose
