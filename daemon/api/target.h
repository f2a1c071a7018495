#pragma once

/// Taking a request's target apart: "/v1/results?after=7".

#include <map>
#include <string>
#include <string_view>

namespace eigenpose {

/// Decodes path and query (percent signs; + in the query is a space).
/// @return false when the target is not a path, is longer than 2000 bytes, or is badly encoded.
bool split_target(std::string_view target, std::string& path, std::map<std::string, std::string>& query);

}  // namespace eigenpose
