#include "daemon/api/request_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <utility>
#include <vector>

#include <boost/asio/buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>

#include "daemon/api/target.h"

namespace eigenpose {
namespace {

namespace http = boost::beast::http;

constexpr std::string_view line_end = "\r\n";
constexpr std::string_view header_end = "\r\n\r\n";

std::string_view view(boost::beast::string_view text) {
  return {text.data(), text.size()};
}

bool is_token(std::string_view text) {
  constexpr std::string_view marks = "!#$%&'*+-.^_`|~";
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           marks.find(c) != std::string_view::npos;
  });
}

bool is_control(char c) {
  return (static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7f;
}

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

Refusal malformed(const std::string& what) {
  return {400, "not a valid HTTP request: " + what, "send HTTP/1.1 as RFC 9112 describes it"};
}

Refusal too_large(std::size_t max_body) {
  return {413, "the request's body is larger than " + std::to_string(max_body) + " bytes",
          "send less, or raise max_body_kib in [api]"};
}

/// Why the request line is refused; nothing if it is good. A minor version above 1 is served as 1.1.
std::optional<Refusal> refuse_request_line(std::string_view line) {
  const std::size_t first = line.find(' ');
  const std::size_t second = first == std::string_view::npos ? first : line.find(' ', first + 1);
  if (second == std::string_view::npos || line.find(' ', second + 1) != std::string_view::npos)
    return malformed("the request line is not METHOD TARGET HTTP/1.1");
  const std::string_view method = line.substr(0, first);
  const std::string_view version = line.substr(second + 1);
  if (!is_token(method)) return malformed("the method is no token");
  if (second == first + 1) return malformed("the target is empty");
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (version.size() != 8 || !version.starts_with("HTTP/") || !is_digit(version[5]) || version[6] != '.' ||
      !is_digit(version[7]))
    return malformed("the version is not HTTP/1.1");
  if (version[5] != '1')
    return Refusal{505, "the version " + std::string(version) + " is not served", "send HTTP/1.1"};
  return std::nullopt;
}

/// Why a field line is refused; nothing if it is good.
std::optional<Refusal> refuse_field_line(std::string_view line) {
  if (line.front() == ' ' || line.front() == '\t') return malformed("a header line is folded");
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon)))
    return malformed("a header line is not NAME: VALUE");
  if (std::any_of(line.begin(), line.end(), is_control))
    return malformed("a header line has a control character");
  return std::nullopt;
}

/// Why the header is refused. @param head ends in an empty line.
std::optional<Refusal> refuse_lines(std::string_view head) {
  std::size_t end = head.find(line_end);
  if (auto refusal = refuse_request_line(head.substr(0, end))) return refusal;
  for (std::size_t start = end + line_end.size(); start < head.size() - line_end.size();
       start = end + line_end.size()) {
    end = head.find(line_end, start);
    if (auto refusal = refuse_field_line(head.substr(start, end - start))) return refusal;
  }
  return std::nullopt;
}

/// Whether what waits for more may be the line before a chunk: CR LF of the chunk before, a size, an
/// extension.
bool may_begin_chunk(std::string_view bytes) {
  for (std::size_t i = 0; i < bytes.size(); ++i)
    if (bytes[i] == '\n' && (i == 0 || bytes[i - 1] != '\r')) return false;
  if (bytes.starts_with(line_end)) bytes.remove_prefix(line_end.size());
  const std::size_t end = bytes.find_first_not_of("0123456789abcdefABCDEF");
  return end == std::string_view::npos ||
         std::string_view("; \t\r").find(bytes[end]) != std::string_view::npos;
}

/// The elements of a list field, over all lines of that name, in lower case.
std::vector<std::string> list_of(const http::fields& fields, http::field name) {
  std::vector<std::string> elements;
  const auto lines = fields.equal_range(name);
  for (auto line = lines.first; line != lines.second; ++line) {
    std::string_view rest = view(line->value());
    for (bool more = true; more;) {
      const std::size_t comma = rest.find(',');
      const std::string_view element = trimmed(rest.substr(0, comma));
      if (!element.empty()) elements.push_back(lower(element));
      more = comma != std::string_view::npos;
      if (more) rest.remove_prefix(comma + 1);
    }
  }
  return elements;
}

}  // namespace

/// The parser, once the header is complete.
struct RequestReader::Body {
  http::request_parser<http::string_body> parser;
  std::size_t fed = 0;      ///< raw bytes of the body
  bool may_be_sent = true;  ///< false while the client waits for "100 Continue"
};

RequestReader::RequestReader(const RequestLimits& limits) : limits_(limits) {}

RequestReader::~RequestReader() = default;

bool RequestReader::has_begun() const {
  return body_ != nullptr || !bytes_.empty();
}

void RequestReader::refuse(int status, std::string error, std::string hint) {
  refusal_ = {status, std::move(error), std::move(hint)};
  state_ = State::refused;
}

RequestReader::State RequestReader::feed(std::string_view bytes) {
  bytes_ += bytes;
  return advance();
}

RequestReader::State RequestReader::go_on() {
  if (state_ == State::needs_continue) {
    body_->may_be_sent = true;
    state_ = State::needs_more;
  }
  return advance();
}

RequestReader::State RequestReader::advance() {
  if (state_ != State::needs_more) return state_;
  if (!body_ && find_head()) {
    const std::size_t end = bytes_.find(header_end) + header_end.size();
    std::string head = bytes_.substr(0, end);
    bytes_.erase(0, end);
    scanned_ = 0;
    open_body(head);
  }
  if (body_ && state_ == State::needs_more) read_body();
  return state_;
}

/// Whether the header is complete. Refuses what can be refused before.
bool RequestReader::find_head() {
  // An empty line before a request is what some clients leave behind a body.
  while (scanned_ == 0 && bytes_.starts_with(line_end)) bytes_.erase(0, line_end.size());
  for (; scanned_ < bytes_.size(); ++scanned_) {
    if (scanned_ >= limits_.max_header) break;
    const char c = bytes_[scanned_];
    const char before = scanned_ > 0 ? bytes_[scanned_ - 1] : '\0';
    if (c == '\0') {
      refusal_ = malformed("its header has a NUL byte");
    } else if ((c == '\n') != (before == '\r')) {
      refusal_ = malformed("its lines do not end in CR LF");
    } else if (c == '\n' && std::string_view(bytes_).substr(0, scanned_ + 1).ends_with(header_end)) {
      return true;
    } else {
      continue;
    }
    state_ = State::refused;
    return false;
  }
  if (scanned_ < limits_.max_header) return false;
  const bool in_first_line = bytes_.find(line_end) >= limits_.max_header && bytes_.find(' ') < 32;
  if (in_first_line)
    refuse(414, "the request's target is too long", "send what is long in the body");
  else
    refuse(431, "the request's header is larger than " + std::to_string(limits_.max_header) + " bytes",
           "send fewer or shorter headers");
  return false;
}

void RequestReader::open_body(std::string_view head) {
  if (auto refusal = refuse_lines(head)) {
    refusal_ = std::move(*refusal);
    state_ = State::refused;
    return;
  }
  std::string known_version(head);
  const std::size_t minor = known_version.find(line_end) - 1;
  next_ = {};
  next_.framing.http_1_0 = known_version[minor] == '0';
  if (!next_.framing.http_1_0) known_version[minor] = '1';
  body_ = std::make_unique<Body>();
  body_->parser.eager(true);
  body_->parser.header_limit(static_cast<std::uint32_t>(limits_.max_header));
  body_->parser.body_limit(limits_.max_body);
  boost::beast::error_code error;
  body_->parser.put(boost::asio::buffer(known_version), error);
  if (!accept_fields()) return;
  if (error) {
    refusal_ = malformed(error.message());
    state_ = State::refused;
    return;
  }
  body_->may_be_sent =
      list_of(body_->parser.get(), http::field::expect).empty() || !bytes_.empty() || next_.framing.http_1_0;
}

/// Refuses what the fields of a well-formed header ask for and must not, or cannot have.
bool RequestReader::accept_fields() {
  const auto& message = body_->parser.get();
  const std::string_view method = view(message.method_string());
  constexpr std::array<std::string_view, 8> methods = {"GET",    "HEAD",    "POST",  "PUT",
                                                       "DELETE", "OPTIONS", "TRACE", "PATCH"};
  if (std::find(methods.begin(), methods.end(), method) == methods.end()) {
    refuse(501, "the method " + std::string(method) + " is not known here",
           "methods are GET, HEAD, POST, DELETE and OPTIONS, in capital letters");
    return false;
  }
  const std::size_t hosts = message.count(http::field::host);
  if (hosts > 1 || (hosts == 0 && !next_.framing.http_1_0) ||
      !is_authority(trimmed(view(message[http::field::host])))) {
    refusal_ = malformed("it needs one Host header with a host, and a port if you like");
    state_ = State::refused;
    return false;
  }
  if (!accept_length()) return false;
  for (const std::string& expected : list_of(message, http::field::expect)) {
    if (next_.framing.http_1_0 || expected == "100-continue") continue;
    refuse(417, "the expectation \"" + expected + "\" is not met here", "expect 100-continue or nothing");
    return false;
  }
  for (const std::string& coding : list_of(message, http::field::content_encoding)) {
    if (coding == "identity") continue;
    refuse(415, "a body in the coding \"" + coding + "\" is not read here", "send it as it is");
    return false;
  }
  auto target = parse_target(view(message.target()), method);
  if (auto* refusal = std::get_if<Refusal>(&target)) {
    refusal_ = std::move(*refusal);
    state_ = State::refused;
    return false;
  }
  Request& request = next_.request;
  request.path = std::move(std::get<Target>(target).path);
  request.query = std::move(std::get<Target>(target).query);
  request.method = method == "HEAD" ? "GET" : std::string(method);
  request.content_type = std::string(view(message[http::field::content_type]));
  request.last_event_id = std::string(view(message["Last-Event-ID"]));
  next_.framing.head_only = method == "HEAD";
  next_.framing.keep_alive = message.keep_alive();
  return true;
}

/// The length of the body has to be said once, in one way (RFC 9112, 6.3).
bool RequestReader::accept_length() {
  const auto& message = body_->parser.get();
  const std::size_t lengths = message.count(http::field::content_length);
  const std::size_t codings = message.count(http::field::transfer_encoding);
  const std::string_view length = trimmed(view(message[http::field::content_length]));
  const bool is_number = !length.empty() && std::all_of(length.begin(), length.end(),
                                                        [](char c) { return c >= '0' && c <= '9'; });
  if (lengths > 1 || (lengths == 1 && !is_number))
    refusal_ = malformed("its Content-Length is not one number");
  else if (codings > 0 && (lengths > 0 || next_.framing.http_1_0))
    refusal_ = malformed("a Transfer-Encoding stands beside a Content-Length, or in HTTP/1.0");
  else if (const auto all = list_of(message, http::field::transfer_encoding);
           codings > 0 && (all.empty() || all.back() != "chunked" ||
                           std::count(all.begin(), all.end(), std::string("chunked")) > 1))
    refusal_ = malformed("its Transfer-Encoding does not end in one \"chunked\"");
  else if (all.size() > 1)
    refusal_ = {501, "the transfer coding \"" + all.front() + "\" is not known here", "send chunked alone"};
  else if (lengths == 1 && (length.size() > 18 || std::stoull(std::string(length)) > limits_.max_body))
    refusal_ = too_large(limits_.max_body);
  else
    return true;
  state_ = State::refused;
  return false;
}

void RequestReader::read_body() {
  auto& parser = body_->parser;
  if (!parser.is_done() && !body_->may_be_sent) {
    state_ = State::needs_continue;
    return;
  }
  while (!parser.is_done() && !bytes_.empty()) {
    boost::beast::error_code error;
    const std::size_t used = parser.put(boost::asio::buffer(bytes_), error);
    bytes_.erase(0, used);
    body_->fed += used;
    // Chunks of one byte take six; more than that beside the data is no body.
    const bool too_much = body_->fed > 8 * limits_.max_body + limits_.max_header;
    if (error == http::error::body_limit || too_much) {
      refusal_ = too_large(limits_.max_body);
    } else if (error && error != http::error::need_more) {
      refusal_ = malformed(error.message());
    } else if (error && bytes_.size() > limits_.max_header) {
      refusal_ = malformed("a line between chunks is too long");
    } else if (error && !may_begin_chunk(bytes_)) {
      refusal_ = malformed("a chunk does not begin with its size");
    } else if (error || used == 0) {
      return;  // it needs more
    } else {
      continue;
    }
    state_ = State::refused;
    return;
  }
  if (parser.is_done()) state_ = State::complete;
}

RequestReader::Taken RequestReader::take() {
  Taken taken = std::move(next_);
  taken.request.body = std::move(body_->parser.get().body());
  body_.reset();
  next_ = {};
  state_ = State::needs_more;
  advance();
  return taken;
}

}  // namespace eigenpose
