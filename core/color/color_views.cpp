#include "core/color/color_views.h"

#include <algorithm>
#include <utility>

namespace eigenpose {
namespace {

double nearest(std::size_t views, std::span<const int> left_out, const auto& distance_to) {
  double least = 1.0;
  for (std::size_t v = 0; v < views; ++v)
    if (std::ranges::find(left_out, static_cast<int>(v)) == left_out.end())
      least = std::min(least, distance_to(v));
  return least;
}

}  // namespace

ColorViews::ColorViews(std::vector<ChromaticityMap> maps) : maps_(std::move(maps)) {
  roots_.reserve(maps_.size());
  for (const ChromaticityMap& map : maps_) roots_.push_back(chromaticity_roots(map));
}

double ColorViews::distance(const ChromaticityRoots& region, std::span<const int> left_out) const {
  return nearest(maps_.size(), left_out,
                 [&](std::size_t v) { return hellinger_distance(region, roots_[v]); });
}

double ColorViews::distance(const ChromaticityMap& region, std::span<const float> visible,
                            std::span<const int> left_out) const {
  const ChromaticityRoots seen = chromaticity_roots(region, visible);
  return nearest(maps_.size(), left_out, [&](std::size_t v) {
    return hellinger_distance(seen, chromaticity_roots(maps_[v], visible));
  });
}

}  // namespace eigenpose
