#pragma once

/// Order statistics and moments of a list of values.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <functional>
#include <ranges>
#include <utility>
#include <vector>

namespace eigenpose {

/// The k-th smallest of `values`, k from 0. Reorders them; O(n). @pre k < n.
template <std::ranges::random_access_range Values, typename Before = std::less<>>
[[nodiscard]] auto order_statistic(Values&& values, std::size_t k, Before before = {}) {
  assert(k < static_cast<std::size_t>(std::ranges::size(values)));
  const auto at = std::ranges::begin(values) + static_cast<std::ptrdiff_t>(k);
  std::ranges::nth_element(values, at, before);
  return *at;
}

/// The value in the middle, of an even number of values the upper one of the two. Reorders them. @pre n ≥ 1.
template <std::ranges::random_access_range Values>
[[nodiscard]] auto upper_median(Values&& values) {
  return order_statistic(values, static_cast<std::size_t>(std::ranges::size(values)) / 2);
}

/// The smallest of the values that at least a share `share` of the others do not exceed: order statistic
/// ⌈share·(n − 1)⌉. Reorders them. @pre n ≥ 1 and 0 ≤ share ≤ 1.
template <std::ranges::random_access_range Values>
[[nodiscard]] auto quantile(Values&& values, double share) {
  const auto last = static_cast<double>(std::ranges::size(values) - 1);
  return order_statistic(values, static_cast<std::size_t>(std::ceil(share * last)));
}

/// Σx/n; 0 of no values.
template <std::ranges::sized_range Values>
[[nodiscard]] double mean(const Values& values) {
  double sum = 0.0;
  for (const auto value : values) sum += static_cast<double>(value);
  return std::ranges::empty(values) ? 0.0 : sum / static_cast<double>(std::ranges::size(values));
}

/// √(Σx²/n); 0 of no values.
template <std::ranges::sized_range Values>
[[nodiscard]] double root_mean_square(const Values& values) {
  double sum = 0.0;
  for (const auto value : values) sum += static_cast<double>(value) * static_cast<double>(value);
  return std::ranges::empty(values) ? 0.0 : std::sqrt(sum / static_cast<double>(std::ranges::size(values)));
}

}  // namespace eigenpose
