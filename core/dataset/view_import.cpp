#include "core/dataset/view_import.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/base/error.h"
#include "core/base/file_lock.h"
#include "core/base/json.h"
#include "core/base/object_name.h"
#include "core/dataset/image_set.h"
#include "core/dataset/image_set_format.h"
#include "core/image/picture_file.h"
#include "core/image/segmentation.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// An object counts as filling a picture when it spans this share of one side. Size-normalised views do,
/// whatever threshold finds them; a turntable seen from above leaves a margin.
constexpr double filling_span = 0.95;
/// The share of views that must be filled for all to count as cropped. One collection is photographed one
/// way, so all its objects are judged together; an object with dark edges alone would be misjudged.
constexpr double filled_views = 0.75;

/// True if what stands out reaches from edge to edge.
bool fills(Segmenter& segmenter, const cv::Mat& image) {
  cv::Rect all;
  for (const Region& region : segmenter.segment(image)) all |= region.box;
  return all.width >= filling_span * image.cols || all.height >= filling_span * image.rows;
}

/// Share of the views an object fills. At most 12 of each object are looked at, evenly spread; those that
/// cannot be read do not count.
double measure_filled(const std::vector<ImportObject>& objects, const std::function<void()>& step) {
  constexpr std::size_t looks = 12;
  Segmenter segmenter;
  std::size_t seen = 0;
  std::size_t filled = 0;
  for (const ImportObject& object : objects) {
    const std::size_t stride = std::max<std::size_t>(1, object.views.size() / looks);
    for (std::size_t i = 0; i < object.views.size(); i += stride) {
      step();
      try {
        const cv::Mat image = load_picture(object.views[i].file);
        if (fills(segmenter, image)) ++filled;
        ++seen;
      } catch (const FileError&) {
        continue;  // named when the object is imported
      }
    }
  }
  return seen == 0 ? 0.0 : static_cast<double>(filled) / static_cast<double>(seen);
}

std::string kind_text(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows) +
         (image.channels() == 3     ? " colour"
          : image.depth() == CV_16U ? " 16-bit grey"
                                    : " grey");
}

/// Decodes a picture. @throws FileError when it cannot be used.
cv::Mat load_alike(const fs::path& file, cv::Mat& first) {
  cv::Mat image = load_picture(file);
  if (first.empty()) first = image;
  if (image.size() != first.size() || image.type() != first.type())
    throw FileError(file, "is " + kind_text(image) + ", the first picture of the object is " +
                              kind_text(first) + "; all views of an object must be alike");
  return image;
}

/// Every view of the set is one of the listed ones. Some may have been left out.
bool made_of(const ImageSet& set, const ImportObject& object, const Workspace& workspace) {
  return set.workspace() == workspace && set.views().size() <= object.views.size() &&
         std::all_of(set.views().begin(), set.views().end(), [&](const ViewRecord& stored) {
           return std::any_of(object.views.begin(), object.views.end(), [&](const ImportView& listed) {
             return stored.q == workspace.canonical(listed.q);
           });
         });
}

/// Imports one object after the other.
class Importer {
 public:
  Importer(const ViewImport& import, const fs::path& root, const json& source,
           const std::function<void()>& step, ImportReport& report)
      : import_(import), root_(root), source_(source), step_(step), report_(report) {}

  void import(const ImportObject& object) {
    if (import_finished(object, root_, import_.workspace, source_)) {
      for (std::size_t i = 0; i < object.views.size(); ++i) step_();
      report_.sets.push_back({object.name, ImageSet::open(root_ / object.name).views().size(), true});
      return;
    }
    ImageSetWriter writer(root_, object.name, import_.workspace, source_, {report_.cropped, false});
    cv::Mat first;
    for (const ImportView& view : object.views) {
      step_();
      add(writer, object.name, view, first);
    }
    const std::size_t needed = least_views(import_.workspace);
    if (writer.views().size() >= std::min(needed, object.views.size()) && !writer.views().empty()) {
      writer.finish();
      report_.sets.push_back({object.name, writer.views().size(), false});
      return;
    }
    std::error_code error;
    fs::remove_all(writer.folder(), error);
    if (error) throw FileError(writer.folder(), "cannot be removed: " + error.message());
    report_.left_out.push_back({object.name,
                                {},
                                true,
                                std::to_string(writer.views().size()) + " of " +
                                    std::to_string(object.views.size()) + " pictures can be used; at least " +
                                    std::to_string(needed) + " are needed"});
  }

 private:
  void add(ImageSetWriter& writer, const std::string& object, const ImportView& view, cv::Mat& first) {
    cv::Mat image;
    try {
      image = load_alike(view.file, first);
    } catch (const FileError& error) {
      if (import_.bad_views == BadViews::refuse) throw;
      const std::string text = error.what();
      const std::string prefix = view.file.string() + ": ";
      report_.left_out.push_back(
          {object, view.file, false, text.starts_with(prefix) ? text.substr(prefix.size()) : text});
      return;
    }
    writer.add(image, view.q, {{"imported_name", view.file.filename().string()}});
  }

  const ViewImport& import_;
  const fs::path& root_;
  const json& source_;
  const std::function<void()>& step_;
  ImportReport& report_;
};

}  // namespace

bool import_finished(const ImportObject& object, const fs::path& root, const Workspace& workspace,
                     const json& source) {
  const fs::path folder = root / object.name;
  std::error_code error;  // where it cannot be looked up, writing it says why
  if (!fs::exists(folder / "set.json", error)) return false;
  const bool own = read_set_source(folder) == parse_json(json_line(source));  // as it is written
  const ImageSet set = ImageSet::open(folder);
  if (set.complete()) {
    if (own && made_of(set, object, workspace)) return true;
    throw FileError(folder, "is an image set already; remove it, or import into another folder");
  }
  if (!own)
    throw FileError(folder, "holds an unfinished image set of " + std::to_string(set.views().size()) +
                                " views that this import did not begin; finish or remove it, or import into "
                                "another folder");
  const FileLock alone(folder / ".lock", "the image set");
  fs::remove_all(folder, error);
  if (error) throw FileError(folder, "cannot be removed: " + error.message());
  return false;
}

std::size_t least_views(const Workspace& workspace) {
  const bool turns = std::any_of(workspace.dofs().begin(), workspace.dofs().end(),
                                 [](const Dof& dof) { return dof.periodic; });
  return turns ? 3 : 2;
}

ImportReport import_views(const ViewImport& import, const fs::path& root, const json& source,
                          const Progress& progress, const std::stop_token& stop) {
  std::size_t total = 0;
  for (const ImportObject& object : import.objects) {
    check_object_name(object.name);
    total += object.views.size();
  }
  const auto check_stop = [&] {
    if (stop.stop_requested()) throw Interrupted("interrupted; the sets finished before are kept");
  };
  ImportReport report;
  report.filled = measure_filled(import.objects, check_stop);
  report.cropped =
      import.kind == ViewKind::measured ? report.filled >= filled_views : import.kind == ViewKind::cropped;
  json described = source;
  described["filled_views_share"] = report.filled;
  std::size_t done = 0;
  const std::function<void()> step = [&] {
    check_stop();
    if (progress) progress({"importing", ++done, total});
  };
  Importer importer(import, root, described, step, report);
  for (const ImportObject& object : import.objects) importer.import(object);
  if (report.sets.empty())
    throw FileError(root,
                    "none of " + std::to_string(import.objects.size()) + " object(s) could be imported; " +
                        (report.left_out.empty() ? "there is no picture" : report.left_out.front().text()));
  return report;
}

}  // namespace eigenpose
