#include "core/base/similar_word.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace eigenpose {
namespace {

/// Levenshtein's distance: how many letters to change, add or drop.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

std::optional<std::string> similar_word(std::string_view word, std::span<const std::string> known) {
  const auto stem = [](std::string_view text) { return text.substr(0, text.rfind('_')); };
  std::optional<std::string> best;
  std::size_t best_distance = 3;  // more than two letters off is another word
  for (const std::string& candidate : known) {
    const bool same_stem = word.find('_') != std::string_view::npos && stem(word) == stem(candidate);
    const std::size_t distance = same_stem ? 1 : edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

}  // namespace eigenpose
