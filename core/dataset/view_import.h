#pragma once

/// What all importers share: listed pictures with their poses become image sets.
///
/// An importer reads names or a table and gives, for each object, which picture shows it in which pose. All
/// else is done here: how the views are to be taken later (cropped or scene), which pictures cannot be used,
/// what stands in the folder already.

#include <cstddef>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/base/progress.h"
#include "core/base/workspace.h"
#include "core/dataset/left_out.h"

namespace eigenpose {

/// How views of an image set are to be taken later.
enum class ViewKind {
  measured,  ///< looked at: cropped when objects fill most pictures from edge to edge
  cropped,   ///< each picture is the object alone
  scene,     ///< the object stands somewhere in the picture
};

/// One picture of an object.
struct ImportView {
  std::filesystem::path file;
  std::vector<double> q;  ///< m values, in the units of the workspace
};

/// All pictures of one object, in the order of their set.
struct ImportObject {
  std::string name;
  std::vector<ImportView> views;
};

/// What is imported, and how.
struct ViewImport {
  std::vector<ImportObject> objects;
  Workspace workspace;
  ViewKind kind = ViewKind::measured;
  BadViews bad_views = BadViews::leave_out;
};

/// What was made.
struct ImportReport {
  struct Set {
    std::string object;
    std::size_t views = 0;
    bool stood_there = false;  ///< an earlier run of the same import had finished it
  };
  std::vector<Set> sets;
  bool cropped = false;
  /// Share of the views looked at in which the object reaches across the whole picture.
  double filled = 0.0;
  std::vector<LeftOut> left_out;
  /// What is usable, but worth a look: gaps in a turn.
  std::vector<std::string> warnings;
};

/// How many views an object needs to be learned: 3 around a turn, 2 along an open DOF.
std::size_t least_views(const Workspace& workspace);

/// Looks at what stands under an object's name before it is imported.
/// @return true where an earlier run of the same import has finished the set; false where nothing stands
/// there now: an unfinished set of the same import is removed.
/// @throws FileError for a set that another import or an acquisition has begun or finished.
bool import_finished(const ImportObject& object, const std::filesystem::path& root,
                     const Workspace& workspace, const nlohmann::json& source);

/// Writes one image set an object below `root`.
///
/// An import that was broken off continues: a set that the same source has finished with the same poses is
/// kept, one that it has begun is begun anew. What another import or an acquisition has begun is never
/// removed.
/// @param source a JSON object that says where the views come from; kept in each set.json. It is what "the
/// same source" compares.
/// @throws FileError naming a set that stands there, a picture that cannot be used (bad_views refuse), or an
/// import without any usable view; what check_object_name throws; Interrupted. Sets finished before stay.
ImportReport import_views(const ViewImport& import, const std::filesystem::path& root,
                          const nlohmann::json& source, const Progress& progress = {},
                          const std::stop_token& stop = {});

}  // namespace eigenpose
