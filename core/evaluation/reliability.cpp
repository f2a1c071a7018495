#include "core/evaluation/reliability.h"

#include <algorithm>
#include <cmath>

namespace eigenpose {

double Reliability::Bin::right_share() const {
  return rate_of(right, regions);
}

Reliability reliability(std::span<const RegionRecord> records) {
  Reliability result;
  for (const RegionRecord& record : records) {
    if (!record.matched()) continue;
    const double confidence = record.confidence > 0.0 ? std::min(record.confidence, 1.0) : 0.0;
    const auto b =
        std::min(static_cast<std::size_t>(confidence * Reliability::bin_count), Reliability::bin_count - 1);
    Reliability::Bin& bin = result.bins[b];
    ++bin.regions;
    if (record.best_is_right()) ++bin.right;
    bin.mean_confidence += confidence;
    ++result.regions;
    if (!record.known) ++result.unknown;
  }
  for (Reliability::Bin& bin : result.bins) {
    if (bin.regions == 0) continue;
    bin.mean_confidence /= static_cast<double>(bin.regions);
    result.expected_calibration_error += static_cast<double>(bin.regions) /
                                         static_cast<double>(result.regions) *
                                         std::abs(bin.right_share() - bin.mean_confidence);
  }
  return result;
}

}  // namespace eigenpose
