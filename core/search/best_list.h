#pragma once

/// What the searches share: the query and the best points found so far.

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/search/patch_set.h"
#include "core/search/search.h"

namespace eigenpose {

/// The nearest points on different manifolds found so far, nearest first; equal distances in the order of the
/// list of manifolds, whatever the order of the search.
class BestList {
 public:
  /// @param slots memory, as many as answers are wanted. @param bound a distance beyond which nothing counts.
  BestList(std::span<PatchPoint> slots, double bound) : slots_(slots), bound_squared_(bound * bound) {}

  /// A point farther than this squared distance changes nothing.
  [[nodiscard]] double cut() const {
    return count_ == slots_.size() ? slots_[count_ - 1].squared_distance : bound_squared_;
  }
  [[nodiscard]] std::span<const PatchPoint> found() const { return slots_.first(count_); }

  void offer(const PatchPoint& point) {
    std::size_t at = 0;
    while (at < count_ && slots_[at].manifold != point.manifold) ++at;
    if (at < count_ && !before(point, slots_[at])) return;
    if (at == count_) {
      if (count_ < slots_.size())
        ++count_;
      else if (before(point, slots_[count_ - 1]))
        --at;
      else
        return;
    }
    for (; at > 0 && before(point, slots_[at - 1]); --at) slots_[at] = slots_[at - 1];
    slots_[at] = point;
  }

 private:
  static bool before(const PatchPoint& a, const PatchPoint& b) {
    return a.squared_distance < b.squared_distance ||
           (a.squared_distance == b.squared_distance && a.manifold < b.manifold);
  }

  std::span<PatchPoint> slots_;
  double bound_squared_;
  std::size_t count_ = 0;
};

/// The memory of one thread for queries; grows to the largest K and count it has seen.
struct QueryMemory {
  std::vector<double> point;      ///< the query in double
  std::vector<PatchPoint> slots;  ///< for BestList
};
QueryMemory& query_memory();

/// Checks the size of the query and copies it into the thread's memory.
/// @throws std::invalid_argument when point.size() ≠ dimensions.
QueryMemory& begin_query(const Eigen::Ref<const Eigen::VectorXf>& point, std::size_t dimensions,
                         std::size_t count);

/// Turns places into answers; small distances are computed from f itself.
std::size_t finish_query(const PatchSet& patches, const BestList& best, const double* point,
                         std::span<ClosestPoint> results);

}  // namespace eigenpose
