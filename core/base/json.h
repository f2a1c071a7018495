#pragma once

/// JSON from outside (requests, image sets, replies): parsed within limits, its values converted strictly.
///
/// The grammar is RFC 8259. Beyond it a text is refused when it names a key twice in one object (the RFC
/// leaves open which value counts), when a number does not fit a double, when a string is not valid UTF-8,
/// and when it exceeds the limits. Conversions never change the kind or the value: `true` is no 1, 20.7
/// and 20.0 are no integers, 4294967297 is no 1.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"

namespace eigenpose {

struct JsonLimits {
  /// Arrays and objects inside each other. Writing and copying a value recurse, so this bounds the stack.
  std::size_t depth = 32;
  /// Values in all, containers included: bounds the memory (about 40 bytes each, and the strings).
  std::size_t values = 1'000'000;
};

/// A text that is not JSON within the limits, or a value of another kind or range than needed. The text says
/// where ("line 2, column 7: …" for what is not JSON, else the name of the key) and what, without a full
/// stop.
class JsonError : public Error {
 public:
  using Error::Error;
};

/// Parses one whole JSON text. Cost: one pass; nothing beyond the limits is built.
/// @throws JsonError. No exception of the JSON library leaves this function.
nlohmann::json parse_json(std::string_view text, const JsonLimits& limits = {});

/// The conversions below return the value as it stands or throw JsonError, which starts with `name` in
/// quotes:
/// "\"components\" is true; allowed: a whole number from 1 to 1024".

std::int64_t json_integer(const nlohmann::json& value, std::string_view name, std::int64_t lower,
                          std::int64_t upper);
/// A finite number from `lower` to `upper`, whether written as an integer or not.
double json_number(const nlohmann::json& value, std::string_view name,
                   double lower = std::numeric_limits<double>::lowest(),
                   double upper = std::numeric_limits<double>::max());
bool json_flag(const nlohmann::json& value, std::string_view name);
std::string json_text(const nlohmann::json& value, std::string_view name);
/// An array of finite numbers, which may be empty.
std::vector<double> json_numbers(const nlohmann::json& value, std::string_view name);

/// The value of `key`. @throws JsonError when `object` is no object or has no such key.
const nlohmann::json& json_member(const nlohmann::json& object, std::string_view key);

/// @throws JsonError when `object` is no object or has a key that is not in `allowed`.
void json_only_keys(const nlohmann::json& object, const std::vector<std::string_view>& allowed);

}  // namespace eigenpose
