#pragma once

/// The colours of one object's learned views.

#include <cstddef>
#include <span>
#include <vector>

#include "core/color/chromaticity.h"

namespace eigenpose {

/// Immutable once made; const calls are thread-safe.
class ColorViews {
 public:
  ColorViews() = default;
  explicit ColorViews(std::vector<ChromaticityMap> maps);

  [[nodiscard]] std::span<const ChromaticityMap> maps() const { return maps_; }  ///< one a view
  /// Hellinger distance of a region to the nearest of the views but those `left_out`; 1 without any.
  [[nodiscard]] double distance(const ChromaticityRoots& region, std::span<const int> left_out = {}) const;
  /// The same where only a part of the region is visible: that part of the views is compared.
  [[nodiscard]] double distance(const ChromaticityMap& region, std::span<const float> visible,
                                std::span<const int> left_out = {}) const;
  [[nodiscard]] std::size_t memory() const {
    return maps_.size() * (sizeof(ChromaticityMap) + sizeof(ChromaticityRoots));
  }

 private:
  std::vector<ChromaticityMap> maps_;
  std::vector<ChromaticityRoots> roots_;  ///< of the maps
};

}  // namespace eigenpose
