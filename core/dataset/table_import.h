#pragma once

/// Image sets from a table: which picture shows which object in which pose.
///
///     file,object,table_deg,light_deg
///     shots/0001.png,mug,0,-30
///     shots/0002.png,mug,12.5,-30
///
/// CSV as of RFC 4180 (csv.h). The columns `file` and `object` may stand anywhere; every other column is one
/// DOF, its name ending in its unit: table_deg, x_mm. Poses may be uneven, have gaps, or be no grid. A file
/// is relative to the table's folder.

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/dataset/view_import.h"

namespace eigenpose {

struct TableImportOptions {
  /// DOFs (column names, with or without unit) that close on themselves, at 360 deg or 2π rad. An angle
  /// closes by itself when its values, taken over all rows, leave no gap larger than 120 degrees around the
  /// circle.
  std::vector<std::string> periodic = {};
  /// DOFs that do not close, whatever their values. A DOF that is no angle never closes.
  std::vector<std::string> open = {};
  std::vector<std::string> ignore = {};  ///< columns that are no DOFs
  ViewKind views = ViewKind::measured;
  BadViews bad_views = BadViews::leave_out;
};

/// Imports all rows of `table` into one image set an object below `root`, all with the same workspace. A
/// column with the same value in every row is no DOF: the report says so. All of the table is checked before
/// the first picture is read.
/// @throws FileError naming table and line: what read_csv throws; no column `file` or `object`, none that is
/// a DOF, a name twice or without a known unit; an empty cell, a value that is no finite number, an object's
/// name that cannot be one, a file that is not there or listed twice for an object; std::invalid_argument for
/// an option that names no column, or contradicts another; what import_views throws.
ImportReport import_table(const std::filesystem::path& table, const std::filesystem::path& root,
                          const TableImportOptions& options, const Progress& progress = {},
                          const std::stop_token& stop = {});

/// The units a column's name may end in, "deg, rad, …", for help texts.
std::string table_units();

}  // namespace eigenpose
