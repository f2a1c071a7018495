#include "config/toml_table.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include "core/base/error.h"
#include "core/base/similar_word.h"

namespace eigenpose {
namespace {

[[noreturn]] void fail_at(const std::string& file, const toml::source_region& where,
                          const std::string& what) {
  throw ConfigError(fmt::format("{}:{}: {}", file, where.begin.line, what));
}

/// The number of keys joined by dots is bounded: the parser would nest one table for each.
constexpr int most_dots = 32;
constexpr std::size_t most_bytes = std::size_t{1} << 20U;

/// Walks over TOML text from one sign that matters for structure to the next, past strings and comments.
class TomlScanner {
 public:
  explicit TomlScanner(std::string_view text) : text_(text) {}

  /// The line of the first key that joins more than `most_dots`; nothing if there is none.
  std::optional<std::size_t> deep_key() {
    int dots = 0;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"' || c == '\'') {
        skip_string(c);
        continue;
      }
      if (c == '#') at_ = std::min(text_.find('\n', at_), text_.size());
      if (c == '.' && ++dots > most_dots)
        return 1 + static_cast<std::size_t>(
                       std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n'));
      if (c == '\n' || c == ',' || c == '=' || c == '{' || c == '[') dots = 0;
      ++at_;
    }
    return std::nullopt;
  }

 private:
  void skip_string(char quote) {
    const std::string end(text_.substr(at_, 3) == std::string(3, quote) ? 3 : 1, quote);
    at_ += end.size();
    while (at_ < text_.size() && text_.substr(at_, end.size()) != end) {
      if (end.size() == 1 && text_[at_] == '\n') return;  // not TOML: the parser will say so
      at_ += quote == '"' && text_[at_] == '\\' ? 2 : 1;
    }
    at_ += end.size();
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace

struct TomlTable::Impl {
  std::shared_ptr<const toml::table> root;  ///< keeps the nodes alive
  const toml::table* table = nullptr;
  std::string file;
  std::string name;  ///< "[camera]", "[[axis]]"; the file itself has none
  std::vector<std::string> known;

  const toml::node* find(std::string_view key) {
    if (std::find(known.begin(), known.end(), key) == known.end()) known.emplace_back(key);
    return table->get(key);
  }
  [[noreturn]] void fail(const toml::node& node, std::string_view key, const std::string& what) const {
    const std::string in = name.empty() ? "" : " in " + name;
    fail_at(file, node.source(), fmt::format("{}{}: {}", key, in, what));
  }
  [[nodiscard]] TomlTable child(const toml::table& node, std::string child_name) const {
    auto impl = std::make_shared<Impl>();
    impl->root = root;
    impl->table = &node;
    impl->file = file;
    impl->name = std::move(child_name);
    return TomlTable(std::move(impl));
  }
  [[noreturn]] void missing(std::string_view key) const {
    fail_at(file, table->source(),
            name.empty() ? fmt::format("{} is missing", key) : fmt::format("{} is missing in {}", key, name));
  }
};

TomlTable::TomlTable(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

TomlTable TomlTable::read_file(const std::filesystem::path& file) {
  // Looked at before it is opened: opening a pipe waits for its other end.
  std::error_code unknown;
  std::ifstream stream;
  if (std::filesystem::is_regular_file(file, unknown)) stream.open(file, std::ios::binary);
  if (!stream.is_open())
    throw ConfigError(file.string() +
                      ": is not a file that can be read: give the configuration with --config FILE");
  // One byte more than is allowed.
  std::string text(most_bytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return parse(text, file.string());
}

TomlTable TomlTable::parse(std::string_view text, const std::string& name) {
  if (text.size() > most_bytes)
    throw ConfigError(fmt::format("{}: more than {} bytes are no configuration", name, most_bytes));
  if (const auto line = TomlScanner(text).deep_key())
    throw ConfigError(
        fmt::format("{}:{}: a key joins more than {} names by dots", name, *line, most_dots + 1));
  auto impl = std::make_shared<Impl>();
  try {
    impl->root = std::make_shared<const toml::table>(toml::parse(text));
  } catch (const toml::parse_error& error) {
    fail_at(name, error.source(), "not valid TOML: " + std::string(error.description()));
  }
  impl->table = impl->root.get();
  impl->file = name;
  return TomlTable(std::move(impl));
}

bool TomlTable::has(std::string_view key) const {
  return impl_->find(key) != nullptr;
}

std::string TomlTable::text(std::string_view key, std::optional<std::string> fallback) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) {
    if (!fallback) impl_->missing(key);
    return *fallback;
  }
  if (!node->is_string()) impl_->fail(*node, key, "a text in quotes is needed");
  return node->as_string()->get();
}

bool TomlTable::flag(std::string_view key, std::optional<bool> fallback) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) {
    if (!fallback) impl_->missing(key);
    return *fallback;
  }
  if (!node->is_boolean()) impl_->fail(*node, key, "true or false is needed");
  return node->as_boolean()->get();
}

double TomlTable::number(std::string_view key, std::optional<double> fallback, double lower,
                         double upper) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) {
    if (!fallback) impl_->missing(key);
    return *fallback;
  }
  const std::optional<double> value = node->is_number() ? node->value<double>() : std::nullopt;
  if (!value || !std::isfinite(*value))
    impl_->fail(*node, key, fmt::format("a number from {} to {} is needed", lower, upper));
  if (*value < lower || *value > upper)
    impl_->fail(*node, key, fmt::format("{} is outside what is allowed: {} to {}", *value, lower, upper));
  return *value;
}

std::int64_t TomlTable::integer(std::string_view key, std::optional<std::int64_t> fallback,
                                std::int64_t lower, std::int64_t upper) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) {
    if (!fallback) impl_->missing(key);
    return *fallback;
  }
  if (!node->is_integer())
    impl_->fail(*node, key, fmt::format("a whole number from {} to {} is needed", lower, upper));
  const std::int64_t value = node->as_integer()->get();
  if (value < lower || value > upper)
    impl_->fail(*node, key, fmt::format("{} is outside what is allowed: {} to {}", value, lower, upper));
  return value;
}

std::string TomlTable::choice(std::string_view key, std::optional<std::string> fallback,
                              std::initializer_list<std::string_view> allowed) const {
  std::string value = text(key, std::move(fallback));
  if (std::find(allowed.begin(), allowed.end(), value) == allowed.end())
    fail(key, fmt::format("\"{}\" is not known; allowed: \"{}\"", value, fmt::join(allowed, "\", \"")));
  return value;
}

std::vector<double> TomlTable::numbers(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  std::vector<double> result;
  if (node == nullptr) return result;
  if (!node->is_array()) impl_->fail(*node, key, "a list of numbers is needed");
  for (const toml::node& element : *node->as_array()) {
    const std::optional<double> value = element.is_number() ? element.value<double>() : std::nullopt;
    if (!value || !std::isfinite(*value)) impl_->fail(element, key, "a list of numbers is needed");
    result.push_back(*value);
  }
  return result;
}

std::vector<std::string> TomlTable::texts(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  std::vector<std::string> result;
  if (node == nullptr) return result;
  if (!node->is_array()) impl_->fail(*node, key, "a list of texts is needed");
  for (const toml::node& element : *node->as_array()) {
    if (!element.is_string()) impl_->fail(element, key, "a list of texts is needed");
    result.push_back(element.as_string()->get());
  }
  return result;
}

std::vector<std::pair<std::string, std::int64_t>> TomlTable::integers(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  std::vector<std::pair<std::string, std::int64_t>> result;
  if (node == nullptr) return result;
  if (!node->is_table()) impl_->fail(*node, key, "a table of whole numbers is needed");
  for (const auto& [name, value] : *node->as_table()) {
    if (!value.is_integer()) impl_->fail(value, name.str(), "a whole number is needed");
    result.emplace_back(name.str(), value.as_integer()->get());
  }
  return result;
}

std::vector<std::pair<std::string, std::string>> TomlTable::text_pairs(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  std::vector<std::pair<std::string, std::string>> result;
  if (node == nullptr) return result;
  if (!node->is_table()) impl_->fail(*node, key, "a table of texts is needed");
  for (const auto& [name, value] : *node->as_table()) {
    if (!value.is_string()) impl_->fail(value, name.str(), "a text in quotes is needed");
    result.emplace_back(name.str(), value.as_string()->get());
  }
  return result;
}

std::optional<TomlTable> TomlTable::table(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  if (node == nullptr) return std::nullopt;
  if (!node->is_table()) impl_->fail(*node, key, fmt::format("a table is needed: [{}]", key));
  return impl_->child(*node->as_table(), fmt::format("[{}]", key));
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) const {
  const toml::node* node = impl_->find(key);
  std::vector<TomlTable> result;
  if (node == nullptr) return result;
  if (node->is_array() && node->as_array()->empty()) return result;
  if (!node->is_array_of_tables())
    impl_->fail(*node, key, fmt::format("a list of tables is needed: [[{}]]", key));
  for (const toml::node& element : *node->as_array())
    result.push_back(impl_->child(*element.as_table(), fmt::format("[[{}]]", key)));
  return result;
}

void TomlTable::finish() const {
  for (const auto& [key, value] : *impl_->table) {
    if (std::find(impl_->known.begin(), impl_->known.end(), key.str()) != impl_->known.end()) continue;
    const std::optional<std::string> meant = similar_word(key.str(), impl_->known);
    std::string what = fmt::format("unknown key \"{}\"", key.str());
    if (!impl_->name.empty()) what += " in " + impl_->name;
    if (meant) what += fmt::format(", did you mean \"{}\"?", *meant);
    what += fmt::format("{} allowed: {}", meant ? "" : ";", fmt::join(impl_->known, ", "));
    fail_at(impl_->file, key.source(), what);
  }
}

std::string TomlTable::place() const {
  return fmt::format("{}:{}", impl_->file, impl_->table->source().begin.line);
}

void TomlTable::fail(std::string_view key, const std::string& what) const {
  const toml::node* node = impl_->table->get(key);
  impl_->fail(node != nullptr ? *node : *impl_->table, key, what);
}

}  // namespace eigenpose
