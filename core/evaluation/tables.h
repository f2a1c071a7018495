#pragma once

/// Results of an evaluation as CSV (RFC 4180, with a header line). Rates are 0…1, angles and lengths in the
/// unit of their DOF. A field without a value is empty.

#include <span>
#include <string>

#include "core/evaluation/evidence_curve.h"
#include "core/evaluation/region_record.h"
#include "core/evaluation/reliability.h"

namespace eigenpose {

/// One line for each record: object, known (1 or 0), view, true_q, verdict ("nothing_found" without a
/// region), said, said_q, answer (right, wrong or withheld of a known object; accepted or rejected of an
/// unknown one), evidence, required_evidence, confidence (the last three only of a matched region),
/// pose_error, other_pose_error. Poses of several DOFs are separated by spaces.
/// @param names of the objects, by index.
std::string records_csv(std::span<const RegionRecord> records, std::span<const std::string> names);

/// One line for each point: threshold, false_rejection, false_acceptance, answered_wrong, in_use. The point
/// in use stands where its threshold belongs, before others of the same threshold, and has in_use 1, all
/// others 0.
std::string curve_csv(const EvidenceCurve& curve);

/// One line for each bin: from, to, regions, right, mean_confidence, right_share. The last two are empty for
/// an empty bin.
std::string reliability_csv(const Reliability& reliability);

}  // namespace eigenpose
