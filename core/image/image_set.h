#pragma once

/// An image set: all views of one object, on disk as ordinary files that a person can look through.
///
///     SETS/mug/set.json      format, version, object, workspace, where it comes from, complete or not
///     SETS/mug/views.jsonl   one JSON object a line: {"file": "000000.png", "q": [0.0], ...}
///     SETS/mug/000000.png    the views
///
/// `views.jsonl` is a journal: a line is appended only after its image is safely on disk, so that an
/// interrupted acquisition keeps everything it has taken and can be continued.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>
#include <opencv2/core.hpp>

#include "core/base/workspace.h"

namespace eigenpose {

/// Where one view stands and what it shows.
struct ViewRecord {
  std::string file;       ///< relative to the set's folder
  std::vector<double> q;  ///< m values, canonical, in the units of the workspace
};

/// An image set as read from disk: the index, not the pixels. Value type.
class ImageSet {
 public:
  /// Reads and checks the index. @throws FileError (missing, malformed, a `q` of the wrong length, a file
  /// twice).
  static ImageSet open(const std::filesystem::path& folder);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] const std::string& object() const { return object_; }
  [[nodiscard]] const Workspace& workspace() const { return workspace_; }
  [[nodiscard]] const std::vector<ViewRecord>& views() const { return views_; }
  /// False while an acquisition is under way or was broken off.
  [[nodiscard]] bool complete() const { return complete_; }

  /// Decodes view i: CV_8UC1, CV_8UC3 (BGR) or CV_16UC1 as stored.
  /// @throws FileError when the file is missing, truncated or not an image.
  [[nodiscard]] cv::Mat load(std::size_t i) const;

 private:
  std::filesystem::path folder_;
  std::string object_;
  Workspace workspace_;
  std::vector<ViewRecord> views_;
  bool complete_ = false;
};

/// Every image set below `root`, ordered by object name with numbers as numbers (obj9 before obj10).
/// @throws FileError when there is none.
std::vector<ImageSet> open_image_sets(const std::filesystem::path& root);

/// Writes an image set view by view. One thread at a time.
class ImageSetWriter {
 public:
  /// Makes `root/object` (and continues an incomplete set of the same object and workspace that stands
  /// there).
  /// @param source a JSON object that says where the views come from; kept in set.json.
  /// @throws FileError when a complete set stands there already or the folder cannot be written;
  /// std::invalid_argument for an object name that is not 1 to 64 of [A-Za-z0-9_.-] starting with a letter or
  /// digit.
  ImageSetWriter(const std::filesystem::path& root, const std::string& object, Workspace workspace,
                 const nlohmann::json& source);
  ImageSetWriter(const ImageSetWriter&) = delete;
  ImageSetWriter& operator=(const ImageSetWriter&) = delete;
  ~ImageSetWriter();

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// Views that stood there when it was opened.
  [[nodiscard]] const std::vector<ViewRecord>& views() const { return views_; }
  /// Image to disk, then its journal line. @throws FileError (disk full, …); then the set is as it was
  /// before.
  void add(const cv::Mat& image, std::vector<double> q);
  /// Marks the set complete.
  void finish();

 private:
  std::filesystem::path folder_;
  std::string object_;
  Workspace workspace_;
  std::vector<ViewRecord> views_;
};

}  // namespace eigenpose
