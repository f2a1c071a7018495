#include "core/base/json.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace eigenpose {
namespace {

using nlohmann::json;

/// "line 2, column 7" of a position in a text; columns count bytes from 1.
std::string position_text(std::string_view text, std::size_t at) {
  const std::string_view before = text.substr(0, std::min(at, text.size()));
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t last = before.rfind('\n');
  const std::size_t column = 1 + (last == std::string_view::npos ? before.size() : before.size() - last - 1);
  return "line " + std::to_string(line) + ", column " + std::to_string(column);
}

/// Builds the value while the limits hold. The base class's calls return false to stop the parser.
class LimitedBuilder final : public nlohmann::json_sax<json> {
 public:
  LimitedBuilder(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  bool null() override { return add(nullptr) != nullptr; }
  bool boolean(bool value) override { return add(value) != nullptr; }
  bool number_integer(number_integer_t value) override { return add(value) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return add(value) != nullptr; }
  bool number_float(number_float_t value, const string_t& /*as_written*/) override {
    return add(value) != nullptr;
  }
  bool string(string_t& value) override { return add(std::move(value)) != nullptr; }
  bool binary(binary_t& value) override { return add(std::move(value)) != nullptr; }
  bool start_object(std::size_t /*size*/) override { return open(json::object()); }
  bool start_array(std::size_t /*size*/) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (open_.back()->contains(name))
      return stop("the key " + json(name).dump() + " is there twice in one object");
    key_ = std::move(name);
    return true;
  }

  bool parse_error(std::size_t at, const std::string& last_token, const json::exception& error) override {
    constexpr int number_overflow = 406;  // the library's number for it
    if (error.id == number_overflow)
      return stop(position_text(text_, text_.substr(0, at).rfind(last_token)) + ": the number " + last_token +
                  " does not fit a double");
    // `at` counts what was read; the last byte of it is the one that does not belong.
    return stop(position_text(text_, at > 0 ? at - 1 : 0) +
                (at > text_.size() ? ": the text ends too early" : ": this is not JSON"));
  }

  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  json take() { return std::move(root_); }

 private:
  bool stop(std::string what) {
    trouble_ = std::move(what);
    return false;
  }

  /// The place the value got; null when there are too many.
  json* add(json value) {
    if (++values_ > limits_.values) {
      stop("it has more than " + std::to_string(limits_.values) + " values");
      return nullptr;
    }
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    return &(parent[std::move(key_)] = std::move(value));
  }

  bool open(json container) {
    if (open_.size() >= limits_.depth)
      return stop("its arrays and objects are nested deeper than " + std::to_string(limits_.depth));
    json* const place = add(std::move(container));
    if (place != nullptr) open_.push_back(place);
    return place != nullptr;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  std::string_view text_;
  const JsonLimits& limits_;
  json root_;
  /// The containers the parser is inside of. Only the innermost grows, so the addresses of the others hold.
  std::vector<json*> open_;
  std::string key_;
  std::size_t values_ = 0;
  std::string trouble_;
};

/// The value as written, short enough for a message.
std::string shown(const json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array";
  constexpr std::size_t longest = 60;
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > longest) text = text.substr(0, longest) + "…";
  return text;
}

[[noreturn]] void refuse(const json& value, std::string_view name, const std::string& allowed) {
  throw JsonError("\"" + std::string(name) + "\" is " + shown(value) + "; allowed: " + allowed);
}

}  // namespace

json parse_json(std::string_view text, const JsonLimits& limits) {
  LimitedBuilder builder(text, limits);
  if (!json::sax_parse(text, &builder)) throw JsonError(builder.trouble());
  return builder.take();
}

std::int64_t json_integer(const json& value, std::string_view name, std::int64_t lower, std::int64_t upper) {
  // Beyond int64 the library keeps integers unsigned, and beyond uint64 as a floating-point number.
  const bool fits =
      value.is_number_unsigned()
          ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())
          : value.is_number_integer();
  if (!fits || value.get<std::int64_t>() < lower || value.get<std::int64_t>() > upper)
    refuse(value, name, "a whole number from " + std::to_string(lower) + " to " + std::to_string(upper));
  return value.get<std::int64_t>();
}

double json_number(const json& value, std::string_view name, double lower, double upper) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (std::isfinite(number) && number >= lower && number <= upper) return number;
  const bool bounded =
      lower > std::numeric_limits<double>::lowest() || upper < std::numeric_limits<double>::max();
  refuse(value, name,
         bounded ? "a number from " + json(lower).dump() + " to " + json(upper).dump() : "a number");
}

bool json_flag(const json& value, std::string_view name) {
  if (!value.is_boolean()) refuse(value, name, "true, false");
  return value.get<bool>();
}

std::string json_text(const json& value, std::string_view name) {
  if (!value.is_string()) refuse(value, name, "a text in quotes");
  return value.get<std::string>();
}

std::vector<double> json_numbers(const json& value, std::string_view name) {
  if (!value.is_array()) refuse(value, name, "an array of numbers");
  std::vector<double> numbers;
  numbers.reserve(value.size());
  for (const json& item : value) numbers.push_back(json_number(item, name));
  return numbers;
}

const json& json_member(const json& object, std::string_view key) {
  if (!object.is_object()) throw JsonError("it is " + shown(object) + "; allowed: an object");
  const auto found = object.find(key);
  if (found == object.end()) throw JsonError("\"" + std::string(key) + "\" is missing");
  return *found;
}

void json_only_keys(const json& object, const std::vector<std::string_view>& allowed) {
  if (!object.is_object()) throw JsonError("it is " + shown(object) + "; allowed: an object");
  for (const auto& [key, value] : object.items()) {
    if (std::find(allowed.begin(), allowed.end(), key) != allowed.end()) continue;
    std::string list;
    for (const std::string_view name : allowed) list += (list.empty() ? "" : ", ") + std::string(name);
    throw JsonError("there is no key " + shown(json(key)) + "; allowed: " + (list.empty() ? "none" : list));
  }
}

}  // namespace eigenpose
