#pragma once

/// Confidence against correctness: of answers with confidence 0.9, are 90 % right?
///
/// Expected calibration error over n matched regions in B bins of equal width (Naeini, Cooper, Hauskrecht,
/// Obtaining Well Calibrated Probabilities Using Bayesian Binning, AAAI 2015):
///
///     ECE = Σ_b (n_b/n) · |share right in b − mean confidence in b|

#include <array>
#include <cstddef>
#include <span>

#include "core/evaluation/region_record.h"

namespace eigenpose {

struct Reliability {
  static constexpr std::size_t bin_count = 10;

  /// Regions whose confidence lies in [b/10, (b + 1)/10); the last bin holds 1 too.
  struct Bin {
    std::size_t regions = 0;
    std::size_t right = 0;         ///< whose best object is the true one; never of an unknown object
    double mean_confidence = 0.0;  ///< 0 of an empty bin

    [[nodiscard]] double right_share() const;  ///< 0 of an empty bin
  };
  std::array<Bin, bin_count> bins;
  std::size_t regions = 0;                  ///< in all bins
  std::size_t unknown = 0;                  ///< of these, of unknown objects
  double expected_calibration_error = 0.0;  ///< 0…1; 0 without regions
};

/// Over the matched regions of known and unknown objects, whatever the verdict. A confidence outside 0…1
/// counts as the nearest value inside.
Reliability reliability(std::span<const RegionRecord> records);

}  // namespace eigenpose
