#pragma once

/// One table of a TOML file, read key by key. What was not asked for when `finish` is called is an unknown
/// key.
///
/// TOML 1.0. Values are never converted: an integer is taken where a floating-point number is needed, and
/// nothing else for another kind. At most 1 MiB, values nested at most 256 deep, 33 names joined by dots.
///
/// Every failure is a ConfigError "FILE:LINE: what: what is allowed". One thread at a time.

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace eigenpose {

/// A cursor into a parsed file. Cheap to copy; copies share what has been asked for.
class TomlTable {
 public:
  /// @throws ConfigError when the file is missing or is not TOML.
  static TomlTable read_file(const std::filesystem::path& file);
  /// @param name stands for the file in messages.
  static TomlTable parse(std::string_view text, const std::string& name);

  [[nodiscard]] bool has(std::string_view key) const;

  /// A value, or `fallback` when the key is absent; without `fallback` the key is required.
  [[nodiscard]] std::string text(std::string_view key, std::optional<std::string> fallback = {}) const;
  [[nodiscard]] bool flag(std::string_view key, std::optional<bool> fallback = {}) const;
  /// A finite number in [lower, upper].
  [[nodiscard]] double number(std::string_view key, std::optional<double> fallback, double lower,
                              double upper) const;
  /// A whole number in [lower, upper], written as one: 20.0 is refused.
  [[nodiscard]] std::int64_t integer(std::string_view key, std::optional<std::int64_t> fallback,
                                     std::int64_t lower, std::int64_t upper) const;
  /// One of `allowed`.
  [[nodiscard]] std::string choice(std::string_view key, std::optional<std::string> fallback,
                                   std::initializer_list<std::string_view> allowed) const;
  /// Absent: an empty list.
  [[nodiscard]] std::vector<double> numbers(std::string_view key) const;
  [[nodiscard]] std::vector<std::string> texts(std::string_view key) const;
  /// Every key of a table whose values are integers: [camera.controls].
  [[nodiscard]] std::vector<std::pair<std::string, std::int64_t>> integers(std::string_view key) const;
  /// Every key of a table whose values are texts: [alarm.text].
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> text_pairs(std::string_view key) const;

  /// The table [key], if it is there.
  [[nodiscard]] std::optional<TomlTable> table(std::string_view key) const;
  /// The tables [[key]], in the order of the file.
  [[nodiscard]] std::vector<TomlTable> tables(std::string_view key) const;

  /// Where the table stands: "FILE:LINE".
  [[nodiscard]] std::string place() const;

  /// Refuses every key that was not asked for, naming the ones that are allowed.
  void finish() const;

  /// Refuses the value of `key` (or the table itself, if `key` is not there).
  [[noreturn]] void fail(std::string_view key, const std::string& what) const;

 private:
  struct Impl;
  explicit TomlTable(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

}  // namespace eigenpose
