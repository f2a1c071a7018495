#pragma once

/// Results of an evaluation as pictures: whole SVG files, to be looked at in a browser or put into a
/// document.

#include <span>
#include <string>

#include "core/evaluation/evidence_curve.h"
#include "core/evaluation/region_record.h"
#include "core/evaluation/reliability.h"

namespace eigenpose {

/// False rejection against false acceptance, both on a scale of decades that begins with 0, and the point in
/// use.
std::string curve_svg(const EvidenceCurve& curve);

/// Share of right regions in each bin of confidence, with its 95 % interval (Wilson 1927), against the
/// diagonal; below it how many regions a bin holds.
std::string reliability_svg(const Reliability& reliability);

/// Rows: the true object; columns: what was said, the last one `withheld`. A cell's colour is its share of
/// the row, on a square-root scale so that one view of many can be seen.
/// @param names of the objects, by index.
std::string confusion_svg(const ConfusionMatrix& matrix, std::span<const std::string> names);

}  // namespace eigenpose
