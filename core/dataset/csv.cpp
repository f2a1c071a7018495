#include "core/dataset/csv.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "core/base/input_file.h"

namespace eigenpose {
namespace {

/// Takes one record after the other off a text.
class CsvReader {
 public:
  CsvReader(const std::filesystem::path& file, std::string_view text) : file_(file), text_(text) {}

  [[nodiscard]] bool done() const { return at_ >= text_.size(); }

  CsvRow next() {
    CsvRow row{line_, {}};
    for (;;) {
      row.fields.push_back(!done() && text_[at_] == '"' ? quoted() : plain());
      if (done() || end_of_line()) return row;
      ++at_;  // the comma
      if (done()) {
        row.fields.emplace_back();
        return row;
      }
    }
  }

 private:
  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw FileError(file_, "line " + std::to_string(line) + ": " + what);
  }

  /// Takes a line end, if one stands here.
  bool end_of_line() {
    if (text_.substr(at_).starts_with("\r\n"))
      at_ += 2;
    else if (text_[at_] == '\n')
      ++at_;
    else
      return false;
    ++line_;
    return true;
  }

  std::string plain() {
    const std::size_t first = at_;
    while (!done() && text_[at_] != ',' && text_[at_] != '\n' && !text_.substr(at_).starts_with("\r\n")) {
      if (text_[at_] == '"')
        fail(line_, "a quote stands inside a field; put the whole field in quotes and double the quote");
      if (text_[at_] == '\r')
        fail(line_, "a carriage return stands inside the line; end lines with LF or CR LF");
      ++at_;
    }
    return std::string(text_.substr(first, at_ - first));
  }

  std::string quoted() {
    const std::size_t opened = line_;
    std::string field;
    for (++at_; !done(); ++at_) {
      if (text_[at_] != '"') {
        if (text_[at_] == '\n') ++line_;
        field += text_[at_];
      } else if (text_.substr(at_).starts_with("\"\"")) {
        field += '"';
        ++at_;
      } else {
        ++at_;
        if (!done() && text_[at_] != ',' && text_[at_] != '\n' && !text_.substr(at_).starts_with("\r\n"))
          fail(line_, "text follows a closing quote; a comma or the line end must");
        return field;
      }
    }
    fail(opened, "the quote that opens a field here is never closed");
  }

  const std::filesystem::path& file_;
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
};

std::string_view without_byte_order_mark(const std::filesystem::path& file, std::string_view text) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    throw FileError(file, "is UTF-16; save it as UTF-8");
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (const auto nul = text.find('\0'); nul != std::string_view::npos)
    throw FileError(
        file, "line " +
                  std::to_string(
                      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n')) +
                  ": holds a NUL byte; it is no text file");
  return text;
}

}  // namespace

CsvTable read_csv(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  CsvReader reader(
      file, without_byte_order_mark(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  CsvTable table;
  bool headed = false;
  while (!reader.done()) {
    CsvRow row = reader.next();
    if (row.fields.size() == 1 && row.fields.front().empty()) continue;
    if (!headed) {
      table.header = std::move(row.fields);
      headed = true;
      continue;
    }
    if (row.fields.size() != table.header.size())
      throw FileError(file, "line " + std::to_string(row.line) + ": has " +
                                std::to_string(row.fields.size()) + " fields, the header has " +
                                std::to_string(table.header.size()) +
                                "; put a field that holds a comma in quotes");
    table.rows.push_back(std::move(row));
  }
  if (!headed) throw FileError(file, "is empty; its first line names the columns");
  if (table.rows.empty()) throw FileError(file, "has a header, but no row below it");
  return table;
}

}  // namespace eigenpose
