#include "daemon/api/http.h"

#include <ctime>

#include <boost/beast/http/status.hpp>
#include <fmt/chrono.h>
#include <nlohmann/json.hpp>

namespace eigenpose {
namespace {

std::string status_line(int status) {
  namespace http = boost::beast::http;
  const auto reason = http::obsolete_reason(http::int_to_status(static_cast<unsigned>(status)));
  return fmt::format("HTTP/1.1 {} {}\r\n", status, std::string_view(reason.data(), reason.size()));
}

/// The fields that every answer has.
std::string common_fields(std::string_view content_type, const Framing& framing) {
  std::string text = fmt::format("Server: eigenposed\r\nDate: {:%a, %d %b %Y %H:%M:%S} GMT\r\n",
                                 fmt::gmtime(std::time(nullptr)));
  if (!content_type.empty()) text += fmt::format("Content-Type: {}\r\n", content_type);
  text += "Cache-Control: no-store\r\n";
  if (!framing.keep_alive)
    text += "Connection: close\r\n";
  else if (framing.http_1_0)
    text += "Connection: keep-alive\r\n";
  return text;
}

}  // namespace

Response error_response(int status, const std::string& error, const std::string& hint) {
  const nlohmann::json body = {{"error", error}, {"hint", hint}};
  return {status,
          "application/json",
          body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
          {}};
}

std::string message_text(const Response& response, const Framing& framing) {
  constexpr int no_content = 204;
  const bool has_body = response.status != no_content;
  std::string text = status_line(response.status);
  text += common_fields(has_body ? response.content_type : "", framing);
  for (const auto& [name, value] : response.headers) text += fmt::format("{}: {}\r\n", name, value);
  if (has_body) text += fmt::format("Content-Length: {}\r\n", response.body.size());
  text += "\r\n";
  if (has_body && !framing.head_only) text += response.body;
  return text;
}

std::string stream_header(std::string_view content_type, const Framing& framing) {
  std::string text = status_line(200) + common_fields(content_type, framing);
  if (!framing.http_1_0) text += "Transfer-Encoding: chunked\r\n";
  return text + "\r\n";
}

}  // namespace eigenpose
