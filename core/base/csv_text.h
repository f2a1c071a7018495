#pragma once

/// Text of CSV files (RFC 4180): fields separated by commas, lines that end in CR LF.

#include <string>
#include <string_view>

namespace eigenpose {

inline constexpr std::string_view csv_line_end = "\r\n";

/// `text` as a field: in quotes where it holds a comma, a quote or a line end.
std::string csv_field(std::string_view text);

/// Appends `value` in as few digits as tell it from other numbers, at most `digits` significant ones; "inf"
/// and "nan" where it is none.
void append_number(std::string& text, double value, int digits = 9);

}  // namespace eigenpose
