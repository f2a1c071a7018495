#pragma once

/// Reading comma-separated values (RFC 4180), strictly, with line numbers for messages.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace eigenpose {

/// One record of a table.
struct CsvRow {
  std::size_t line = 0;  ///< of the file, where it begins; the first line is 1
  std::vector<std::string> fields;
};

/// A table: a header and rows of as many fields.
struct CsvTable {
  std::vector<std::string> header;
  std::vector<CsvRow> rows;
};

/// Reads UTF-8 text with or without a byte order mark; lines end in CRLF or LF, the last may end without.
/// Fields in quotes may hold commas, line ends and doubled quotes. Empty lines are skipped. Spaces belong to
/// their field.
/// @throws FileError naming the line: a quote that does not close or stands inside a plain field, text after
/// a closing quote, a row with more or fewer fields than the header, a NUL, UTF-16; a table without a row.
CsvTable read_csv(const std::filesystem::path& file);

}  // namespace eigenpose
