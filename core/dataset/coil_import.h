#pragma once

/// Turning photographs named as the COIL collections name theirs into image sets.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/progress.h"

namespace eigenpose {

/// What the number in `obj3__17.png` means.
struct CoilAngle {
  /// Degrees one step of the number stands for: 5 in COIL-20 (an index), 1 in COIL-100 (degrees).
  double degrees_per_step = 1.0;
};

/// How views of an image set are to be taken later.
enum class ViewKind {
  measured,  ///< looked at: cropped when objects fill most pictures of the folder from edge to edge
  cropped,   ///< each picture is the object alone
  scene,     ///< the object stands somewhere in the picture
};

struct CoilImportOptions {
  CoilAngle angle;
  ViewKind views = ViewKind::measured;
};

/// What was made.
struct ImportReport {
  struct Set {
    std::string object;
    std::size_t views = 0;
  };
  std::vector<Set> sets;
  bool cropped = false;
  /// Share of all views in which the object reaches across the whole picture.
  double filled = 0.0;
};

/// Imports every `<object>__<number>.png` of `folder` into one image set an object below `root`.
///
/// Strict: the pictures of an object must stand evenly around a full turn, be of one size and kind, and no
/// other file may lie between them (hidden files apart). Everything is checked by name before the first
/// picture is read.
/// @throws FileError naming the file; Interrupted. Sets finished before stay; an unfinished one is removed.
ImportReport import_coil(const std::filesystem::path& folder, const std::filesystem::path& root,
                         const CoilImportOptions& options, const Progress& progress = {},
                         std::stop_token stop = {});

}  // namespace eigenpose
