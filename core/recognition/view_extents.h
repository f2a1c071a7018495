#pragma once

/// How large the learned views are in the picture: what separates objects that touch.

#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/model/parts_model.h"

namespace eigenpose {

/// Learned views of about the same size.
struct ViewExtent {
  cv::Size size;
  std::vector<std::size_t> objects;
};

/// Immutable once made.
class ViewExtents {
 public:
  /// Of no views: nothing is known of sizes.
  ViewExtents() = default;
  explicit ViewExtents(const PartsModel& parts);

  [[nodiscard]] bool empty() const { return groups_.empty(); }
  [[nodiscard]] std::span<const ViewExtent> groups() const { return groups_; }
  /// The smallest width and the smallest height of all views. @pre not empty.
  [[nodiscard]] const cv::Size& least() const { return least_; }
  /// A region as large as this may be two objects.
  [[nodiscard]] bool may_be_two(const cv::Size& region) const;

 private:
  /// @param same share of the larger side by which sizes of one group differ at most.
  void group(const PartsModel& parts, double same);

  std::vector<ViewExtent> groups_;
  cv::Size least_;
};

}  // namespace eigenpose
