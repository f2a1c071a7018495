#pragma once

/// Image sets of parts that lie flat under a camera: seen from above they only turn in the picture's plane,
/// so that one picture of each is enough.

#include <cstddef>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/image/segmentation.h"

namespace eigenpose {

struct TurnedImportOptions {
  /// Names of the parts from left to right (by the left edges of their boxes); empty: part1, part2, …
  std::vector<std::string> names = {};
  std::size_t views = 36;  ///< evenly around a full turn; 2 to 3600
  SegmentationOptions segmentation = {};
};

/// Cuts every part out of one picture and writes an image set of it, turned in the picture's plane; a view's
/// `table` is by how many degrees, counter-clockwise, from how the part lies in the picture. What touches the
/// picture's border is left out. Names are checked before anything is written; sets finished before an error
/// stay, and the same import called again continues behind them.
/// @returns the names. @throws FileError naming the file: not a picture, no part in it, as many names as
/// there are not parts, a set that stands there already; std::invalid_argument for options out of range;
/// Interrupted.
std::vector<std::string> import_turned(const std::filesystem::path& picture,
                                       const std::filesystem::path& root, const TurnedImportOptions& options,
                                       const Progress& progress = {}, const std::stop_token& stop = {});

}  // namespace eigenpose
