#pragma once

/// The one place where text from outside (file names, object names, messages of devices and peers) is made
/// fit to be printed or logged.

#include <string>
#include <string_view>

namespace eigenpose {

/// `text` as one line of harmless UTF-8. Line breaks become "\n", "\r"; other control characters (ESC, NUL,
/// …), bytes that are not UTF-8, and characters that reorder or break lines (U+0080…U+009F, U+2028…U+202E,
/// U+2066…U+2069) become
/// "\xNN" for each byte. Everything else is kept as it is, a backslash too.
std::string printable(std::string_view text);

}  // namespace eigenpose
