#include "daemon/api/target.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <vector>

namespace eigenpose {
namespace {

constexpr std::size_t longest_target = 2000;

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool is_alphanumeric(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 && static_cast<unsigned char>(c) < 0x80;
}

/// The characters of RFC 3986 that may stand in a path or query as they are, and the percent sign.
bool may_stand_in_target(char c) {
  return is_alphanumeric(c) || std::string_view("-._~!$&'()*+,;=:@/?%").find(c) != std::string_view::npos;
}

enum class Part { path, query };

std::optional<std::string> decode(std::string_view text, Part part) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
      const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
      if (low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
      if (c == '/' && part == Part::path) {
        decoded += "%2F";
        continue;
      }
    } else if (c == '+' && part == Part::query) {
      c = ' ';
    }
    if (c == '\0') return std::nullopt;
    decoded += c;
  }
  return decoded;
}

/// "/a/./b/../c" → "/a/c" (RFC 3986, 5.2.4), segment by segment after decoding.
std::optional<std::string> decoded_path(std::string_view path) {
  std::vector<std::string> segments;
  bool is_folder = false;  // ends in a slash
  while (!path.empty()) {
    path.remove_prefix(1);
    const std::size_t end = std::min(path.find('/'), path.size());
    auto segment = decode(path.substr(0, end), Part::path);
    if (!segment) return std::nullopt;
    path.remove_prefix(end);
    is_folder = *segment == "." || *segment == "..";
    if (*segment == ".." && !segments.empty()) segments.pop_back();
    if (!is_folder) segments.push_back(std::move(*segment));
  }
  std::string joined;
  for (const std::string& segment : segments) joined += "/" + segment;
  if (is_folder || joined.empty()) joined += "/";
  return joined;
}

std::variant<Target, Refusal> bad_encoding() {
  return Refusal{400, "the request's target is badly encoded",
                 "write a percent sign as %25, and no NUL byte at all"};
}

}  // namespace

bool is_authority(std::string_view text) {
  const std::size_t bracket = text.find(']');
  const std::size_t colon = text.find(':', bracket == std::string_view::npos ? 0 : bracket);
  const std::string_view host = text.substr(0, colon);
  const std::string_view port = colon == std::string_view::npos ? std::string_view() : text.substr(colon + 1);
  const bool is_literal = host.starts_with('[') && host.ends_with(']') && host.size() > 2;
  const std::string_view name = is_literal ? host.substr(1, host.size() - 2) : host;
  const std::string_view more = is_literal ? "-._~!$&'()*+,;=:" : "-._~!$&'()*+,;=%";
  return std::all_of(name.begin(), name.end(),
                     [&](char c) { return is_alphanumeric(c) || more.find(c) != std::string_view::npos; }) &&
         std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::variant<Target, Refusal> parse_target(std::string_view target, std::string_view method) {
  if (target.size() > longest_target)
    return Refusal{414, "the request's target is longer than " + std::to_string(longest_target) + " bytes",
                   "send what is long in the body"};
  if (target == "*" && method == "OPTIONS") return Target{"*", {}};
  constexpr std::string_view scheme = "http://";
  const bool is_absolute =
      target.size() >= scheme.size() &&
      std::equal(scheme.begin(), scheme.end(), target.begin(), [](char wanted, char given) {
        return wanted == std::tolower(static_cast<unsigned char>(given));
      });
  if (is_absolute) {
    target.remove_prefix(scheme.size());
    const std::size_t end = std::min(target.find_first_of("/?"), target.size());
    if (end == 0 || !is_authority(target.substr(0, end)))
      return Refusal{400, "the request's target names no host", "ask for a path such as /v1/status"};
    target.remove_prefix(end);
  }
  const std::size_t mark = target.find('?');
  const std::string_view path = target.substr(0, mark);
  const bool is_path = path.empty() ? is_absolute : path[0] == '/';
  if (!is_path || !std::all_of(target.begin(), target.end(), may_stand_in_target))
    return Refusal{400, "the request's target is not understood", "ask for a path such as /v1/status"};
  Target result;
  auto decoded = decoded_path(path);
  if (!decoded) return bad_encoding();
  result.path = std::move(*decoded);
  std::string_view rest = mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
  while (!rest.empty()) {
    const std::string_view pair = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(pair.size() + 1, rest.size()));
    const std::size_t equals = std::min(pair.find('='), pair.size());
    const auto key = decode(pair.substr(0, equals), Part::query);
    const auto value = decode(pair.substr(std::min(equals + 1, pair.size())), Part::query);
    if (!key || !value) return bad_encoding();
    if (pair.empty()) continue;
    if (!result.query.emplace(*key, *value).second)
      return Refusal{400, "the query names \"" + *key + "\" twice", "give each key once"};
  }
  return result;
}

}  // namespace eigenpose
