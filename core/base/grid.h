#pragma once

/// Points on a regular grid: flat index ↔ one index an axis.

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace eigenpose {

/// A grid of counts[0] × counts[1] × … points, numbered with the last axis fastest. Value type; const calls
/// are thread-safe and take no memory.
class Grid {
 public:
  Grid() = default;  ///< no axis, one point
  explicit Grid(std::vector<std::size_t> counts) : counts_(std::move(counts)), strides_(counts_.size()) {
    for (std::size_t a = counts_.size(); a-- > 0;) {
      strides_[a] = size_;
      size_ *= counts_[a];
    }
  }

  [[nodiscard]] std::size_t axes() const { return counts_.size(); }
  /// Points of the whole grid.
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Points along one axis.
  [[nodiscard]] std::size_t count(std::size_t axis) const { return counts_[axis]; }
  /// Distance in flat indices between neighbours along an axis.
  [[nodiscard]] std::size_t stride(std::size_t axis) const { return strides_[axis]; }

  /// The index along `axis` of the point `flat`.
  [[nodiscard]] std::size_t index(std::size_t flat, std::size_t axis) const {
    return flat / strides_[axis] % counts_[axis];
  }
  /// The flat index of a point. @param indices one an axis, each below its count.
  template <typename Indices>
  [[nodiscard]] std::size_t flat(const Indices& indices) const {
    std::size_t result = 0;
    for (std::size_t a = 0; a < counts_.size(); ++a)
      result += static_cast<std::size_t>(indices[a]) * strides_[a];
    return result;
  }

  /// The point `steps` away from `flat` along `axis`. Round the seam of a `closed` axis; nothing beyond the
  /// end of an open one.
  enum class Ends { open, closed };
  [[nodiscard]] std::optional<std::size_t> neighbour(std::size_t flat, std::size_t axis, std::ptrdiff_t steps,
                                                     Ends ends) const {
    const auto count = static_cast<std::ptrdiff_t>(counts_[axis]);
    const auto here = static_cast<std::ptrdiff_t>(index(flat, axis));
    std::ptrdiff_t there = here + steps;
    if (ends == Ends::closed)
      there = (there % count + count) % count;
    else if (there < 0 || there >= count)
      return std::nullopt;
    return static_cast<std::size_t>(static_cast<std::ptrdiff_t>(flat) +
                                    (there - here) * static_cast<std::ptrdiff_t>(strides_[axis]));
  }

 private:
  std::vector<std::size_t> counts_;
  std::vector<std::size_t> strides_;
  std::size_t size_ = 1;
};

}  // namespace eigenpose
