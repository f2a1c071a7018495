#pragma once

/// How a cut-out lies beside the learned views, and undoing it.

#include <span>

namespace eigenpose {

/// How a region is misaligned with the learned views: brightness is multiplied by 1 + gain; the region's
/// centre is moved by (dx, dy), it is enlarged by 1 + scale and turned by `rotation` about its middle.
struct Misalignment {
  static constexpr int unknowns = 5;
  double gain = 0.0;
  double dx = 0.0;  ///< share of the picture's side
  double dy = 0.0;
  double scale = 0.0;
  double rotation = 0.0;  ///< radians
};

/// Samples `appearance` (side × side × bands, row by row) with a misalignment undone, gain apart. Bilinear;
/// beyond its edge the appearance goes on as it ends.
/// @param out as long as `appearance`, not overlapping it.
/// @return the energy ‖out‖.
float undo_misalignment(std::span<const float> appearance, int side, int bands,
                        const Misalignment& misalignment, std::span<float> out);

}  // namespace eigenpose
