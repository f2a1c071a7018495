#include "core/base/printable.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace eigenpose {
namespace {

struct Decoded {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  ///< 0: not UTF-8
};

/// The character that `text` begins with. Overlong forms, surrogates and codes above U+10FFFF are not UTF-8.
Decoded decode(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return {};
  std::uint32_t code = lead & (0x7fU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0U) != 0x80U) return {};
    code = code << 6 | (byte(i) & 0x3fU);
  }
  constexpr std::array<std::uint32_t, 5> smallest{0, 0, 0x80, 0x800, 0x10000};
  if (code < smallest[length] || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return {};
  return {code, length};
}

bool harmless(std::uint32_t code) {
  return code >= 0x20 && !(code >= 0x7f && code <= 0x9f) && !(code >= 0x2028 && code <= 0x202e) &&
         !(code >= 0x2066 && code <= 0x2069);
}

void append_escaped(std::string& line, unsigned char byte) {
  constexpr std::string_view digits = "0123456789abcdef";
  if (byte == '\n')
    line += "\\n";
  else if (byte == '\r')
    line += "\\r";
  else if (byte == '\t')
    line += "\\t";
  else
    line.append("\\x").append(1, digits[byte >> 4U]).append(1, digits[byte & 0xfU]);
}

}  // namespace

std::string printable(std::string_view text) {
  std::string line;
  line.reserve(text.size());
  while (!text.empty()) {
    const Decoded next = decode(text);
    const std::size_t bytes = next.bytes == 0 ? 1 : next.bytes;
    if (next.bytes > 0 && harmless(next.code))
      line += text.substr(0, bytes);
    else
      for (const char c : text.substr(0, bytes)) append_escaped(line, static_cast<unsigned char>(c));
    text.remove_prefix(bytes);
  }
  return line;
}

}  // namespace eigenpose
