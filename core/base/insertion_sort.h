#pragma once

/// A stable sort of a few elements that takes no memory (std::stable_sort does).

#include <ranges>
#include <utility>

namespace eigenpose {

/// Sorts by `before`; equal elements keep their order. O(n²): for a dozen elements at most.
template <std::ranges::random_access_range Range, typename Before>
void insertion_sort(Range&& elements, Before before) {
  for (auto next = std::ranges::begin(elements); next != std::ranges::end(elements); ++next) {
    auto element = std::move(*next);
    auto place = next;
    for (; place != std::ranges::begin(elements) && before(element, *(place - 1)); --place)
      *place = std::move(*(place - 1));
    *place = std::move(element);
  }
}

}  // namespace eigenpose
