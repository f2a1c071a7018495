#pragma once

/// Turning photographs named as the COIL collections name theirs into image sets.

#include <filesystem>
#include <stop_token>

#include "core/base/progress.h"
#include "core/dataset/view_import.h"

namespace eigenpose {

/// What the number in `obj3__17.png` means.
struct CoilAngle {
  /// Degrees one step of the number stands for: 5 in COIL-20 (an index), 1 in COIL-100 (degrees).
  double degrees_per_step = 1.0;
};

struct CoilImportOptions {
  CoilAngle angle;
  ViewKind views = ViewKind::measured;
  /// `refuse` also wants the views of an object to stand evenly around the turn.
  BadViews bad_views = BadViews::leave_out;
};

/// Imports every `<object>__<number>.png` of `folder` into one image set an object below `root`. The number
/// may have decimals (`mug__12.5.png`), and angles may be uneven; the report warns of a gap.
///
/// No other file may lie between them (hidden files apart). Everything is checked by name before the first
/// picture is read.
/// @throws FileError naming a file with another name, two pictures of one angle, an angle beyond one turn, or
/// an object with fewer than 3 pictures; what import_views throws. Sets finished before stay.
ImportReport import_coil(const std::filesystem::path& folder, const std::filesystem::path& root,
                         const CoilImportOptions& options, const Progress& progress = {},
                         std::stop_token stop = {});

}  // namespace eigenpose
