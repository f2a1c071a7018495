#pragma once

/// Which known word was meant by one that is not known.

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace eigenpose {

/// The known word that differs from `word` in the fewest letters, at most two; nothing if there is none. A
/// wrong unit behind the last "_" (settle_s for settle_ms) counts as one letter. Of equals the first.
std::optional<std::string> similar_word(std::string_view word, std::span<const std::string> known);

}  // namespace eigenpose
