#include "core/base/object_name.h"

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "core/base/printable.h"

namespace eigenpose {

void check_object_name(const std::string& name) {
  // Not isalnum: what a letter is must not depend on the locale.
  constexpr std::string_view first = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";
  constexpr std::string_view more = "_.-";
  const auto in = [](std::string_view set, char c) { return set.find(c) != std::string_view::npos; };
  const bool good =
      !name.empty() && name.size() <= 64 && in(first, name.front()) &&
      std::all_of(name.begin(), name.end(), [&](char c) { return in(first, c) || in(more, c); });
  if (good) return;
  constexpr std::size_t shown = 80;
  const std::string text = name.size() > shown ? printable(name.substr(0, shown)) + "…" : printable(name);
  throw std::invalid_argument(
      "\"" + text +
      "\" cannot be an object's name; use 1 to 64 of A-Z a-z 0-9 _ . - and begin with a "
      "letter or digit");
}

}  // namespace eigenpose
