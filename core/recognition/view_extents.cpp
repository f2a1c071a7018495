#include "core/recognition/view_extents.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace eigenpose {
namespace {

/// Learned sizes that differ by less than this share of the larger side are tried as one.
constexpr double same_extent = 0.12;
constexpr std::size_t most_extents = 40;  ///< where there are more, sizes are distinguished less finely

}  // namespace

ViewExtents::ViewExtents(const PartsModel& parts) {
  for (double same = same_extent; groups_.empty() || groups_.size() > most_extents; same *= 1.3) {
    group(parts, same);
    if (groups_.empty()) break;
  }
}

void ViewExtents::group(const PartsModel& parts, double same) {
  groups_.clear();
  least_ = {std::numeric_limits<int>::max(), std::numeric_limits<int>::max()};
  for (std::size_t o = 0; o < parts.extents.size(); ++o) {
    for (const cv::Size& size : parts.extents[o]) {
      if (size.empty()) continue;  // views of this object came ready-cut
      least_ = {std::min(least_.width, size.width), std::min(least_.height, size.height)};
      const double side = std::max(size.width, size.height);
      const auto like = std::ranges::find_if(groups_, [&](const ViewExtent& known) {
        return std::abs(known.size.width - size.width) < same * side &&
               std::abs(known.size.height - size.height) < same * side;
      });
      ViewExtent& extent = like != groups_.end() ? *like : groups_.emplace_back(ViewExtent{size, {}});
      if (extent.objects.empty() || extent.objects.back() != o) extent.objects.push_back(o);
    }
  }
}

bool ViewExtents::may_be_two(const cv::Size& region) const {
  return !empty() && region.width >= least_.width && region.height >= least_.height &&
         (region.width >= 1.2 * least_.width || region.height >= 1.2 * least_.height);
}

}  // namespace eigenpose
