#pragma once

/// The target of a request, split into path and query: "/v1/results?after=7".

#include <map>
#include <string>
#include <string_view>
#include <variant>

#include "daemon/api/http.h"

namespace eigenpose {

struct Target {
  std::string path;
  std::map<std::string, std::string> query;
};

/// Reads a target in origin form ("/v1/status"), absolute form ("http://host/v1/status"), or for the method
/// OPTIONS asterisk form ("*"). Percent signs are decoded, a + in the query is a space, the segments "." and
/// ".." of the path are resolved. A slash that was encoded stays "%2F", so that it separates nothing.
/// @return a refusal with status 400, or 414 for more than 2000 bytes.
std::variant<Target, Refusal> parse_target(std::string_view target, std::string_view method);

/// Whether `text` may stand in a Host field: a host and, after a colon, a port; or nothing.
bool is_authority(std::string_view text);

}  // namespace eigenpose
