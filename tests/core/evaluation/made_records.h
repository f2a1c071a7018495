#pragma once

/// Records of evaluations that never were, for tests of counting and drawing.

#include "core/evaluation/region_record.h"

namespace eigenpose::testing {

/// A view of `object` of which `said` was said.
inline RegionRecord made_record(std::size_t object, std::size_t said, Verdict verdict,
                                double evidence = 0.0) {
  RegionRecord record;
  record.object = object;
  record.said = said;
  record.verdict = verdict;
  record.evidence = evidence;
  return record;
}

inline RegionRecord unknown_object(RegionRecord record) {
  record.known = false;
  return record;
}

/// A view in which nothing was found.
inline RegionRecord nothing_found(std::size_t object) {
  RegionRecord record;
  record.object = object;
  return record;
}

}  // namespace eigenpose::testing
