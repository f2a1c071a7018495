#pragma once

/// An image set: all views of one object, on disk as ordinary files that a person can look through.
///
///     SETS/mug/set.json      format, version, object, workspace, source, cropped, complete
///     SETS/mug/views.jsonl   one JSON object a line: {"file": "000000.png", "q": [0.0], ...}
///     SETS/mug/000000.png    the views
///
/// `views.jsonl` is a journal: a line is appended only after its image is safely on disk, so that an
/// interrupted acquisition keeps everything it has taken and can be continued. A last line without its end,
/// left by a crash, does not count. While a writer lives it holds SETS/mug/.lock.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>
#include <opencv2/core.hpp>

#include "core/base/error.h"
#include "core/base/object_name.h"
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
  /// The views are ready-cut pictures of the object alone: each is taken whole, not segmented again.
  [[nodiscard]] bool cropped() const { return cropped_; }
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
  bool cropped_ = false;
  bool complete_ = false;
};

/// Image sets below a folder, and those that had to be left out.
struct FoundImageSets {
  std::vector<ImageSet> sets;  ///< ordered by object name with numbers as numbers (obj9 before obj10)
  /// One for each folder that cannot be used: unreadable, malformed, or of the same object as another.
  std::vector<FileError> left_out;
};

/// The image set that `root` is, or every one below it. One folder that cannot be used does not stop the
/// others.
/// @throws FileError when there is none that can be used, or `root` itself is a set and cannot.
FoundImageSets find_image_sets(const std::filesystem::path& root);

/// The same for callers who need all of them: the first one left out is thrown. @throws FileError.
std::vector<ImageSet> open_image_sets(const std::filesystem::path& root);

/// What a writer promises and records, beside the views.
struct ImageSetOptions {
  /// See ImageSet::cropped.
  bool cropped = false;
  /// True: every view is on the disk when `add` returns (an acquisition takes seconds a view). False: only
  /// when `finish` returns (a conversion can be started again).
  bool sync_every_view = true;
};

/// Writes an image set view by view. One thread at a time. While it lives it owns the folder: a second
/// writer, also of another program, is refused.
class ImageSetWriter {
 public:
  /// Makes `root/object` (and continues an incomplete set of the same object and workspace that stands
  /// there).
  /// @param source a JSON object that says where the views come from; kept in set.json. A set that has views
  /// already keeps the one they were taken with: whether the two go together, the caller must see.
  /// @throws FileError when a complete set stands there already, another writer has it, or the folder cannot
  /// be written; what check_object_name throws.
  ImageSetWriter(const std::filesystem::path& root, const std::string& object, Workspace workspace,
                 const nlohmann::json& source, ImageSetOptions options = {});
  ImageSetWriter(const ImageSetWriter&) = delete;
  ImageSetWriter& operator=(const ImageSetWriter&) = delete;
  ~ImageSetWriter();

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// The source that stands in set.json.
  [[nodiscard]] nlohmann::json source() const;
  /// Views that stood there when it was opened.
  [[nodiscard]] const std::vector<ViewRecord>& views() const { return views_; }
  /// Image to disk, then its journal line. @throws FileError (disk full, …); then the set is as it was
  /// before, unless the journal's flush alone failed: then the view is counted, and may be lost with the
  /// power; std::invalid_argument for a `q` of the wrong length or not finite, or a picture of another kind.
  void add(const cv::Mat& image, std::vector<double> q);
  /// The same with further facts about this view, kept in its journal line (a JSON object, e.g.
  /// {"exposure_us": 5}).
  void add(const cv::Mat& image, std::vector<double> q, const nlohmann::json& facts);
  /// Marks the set complete. @throws FileError, also for a set without views.
  void finish();

 private:
  struct Files;

  /// Reads the unfinished set that stands in the folder. @return the bytes of its journal that are good.
  std::uint64_t take_up();
  /// The set is as it was before: no line of the view in the journal, no picture without a line.
  void drop_view(const std::filesystem::path& file, std::uint64_t journal_bytes) noexcept;

  std::filesystem::path folder_;
  std::string object_;
  Workspace workspace_;
  ImageSetOptions options_;
  std::vector<ViewRecord> views_;
  std::unique_ptr<Files> files_;
  std::string source_;         ///< JSON text
  std::size_t next_file_ = 0;  ///< number of the next file name
};

}  // namespace eigenpose
