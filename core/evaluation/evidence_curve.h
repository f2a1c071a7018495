#pragma once

/// Both kinds of error against the threshold on evidence: the receiver operating characteristic (ROC).
///
/// With threshold t a region is accepted where its evidence e ≥ t. Where more or less was required of a
/// region than of most (of occluded ones), e is what it has beyond its own requirement, added to the usual
/// one. For n₁ known views and n₀ views of unknown objects, e = −∞ for views without a matched region:
///
///     false rejection(t)  = #{known:   e < t} / n₁
///     false acceptance(t) = #{unknown: e ≥ t} / n₀
///     answered wrong(t)   = #{known:   e ≥ t, and the best object is another} / n₁
///
/// so the share 1 − false rejection − answered wrong is answered right. Ambiguity is not part of it: a region
/// between two objects has as much evidence as it has.

#include <cstddef>
#include <span>
#include <vector>

#include "core/evaluation/region_record.h"

namespace eigenpose {

struct EvidenceCurve {
  struct Point {
    double threshold = 0.0;
    double false_rejection = 0.0;
    double false_acceptance = 0.0;
    double answered_wrong = 0.0;
  };
  /// One point for each value of evidence, rising thresholds: rising false rejection, falling false
  /// acceptance. The last has threshold ∞: nothing is accepted.
  std::vector<Point> points;
  /// As the records were decided: each region accepted where its evidence reaches its own required evidence.
  /// The threshold is the upper median of those.
  Point in_use;
  std::size_t known = 0;    ///< views
  std::size_t unknown = 0;  ///< views
};

/// O(n log n). @throws std::invalid_argument without known or without unknown objects.
EvidenceCurve evidence_curve(std::span<const RegionRecord> records);

}  // namespace eigenpose
