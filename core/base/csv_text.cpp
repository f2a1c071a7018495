#include "core/base/csv_text.h"

#include <array>
#include <charconv>

namespace eigenpose {

std::string csv_field(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + '"';
}

void append_number(std::string& text, double value, int digits) {
  std::array<char, 40> written;
  const auto end = std::to_chars(written.data(), written.data() + written.size(), value,
                                 std::chars_format::general, digits);
  text.append(written.data(), end.ptr);
}

}  // namespace eigenpose
