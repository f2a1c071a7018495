#include "core/dataset/coil_import.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/dataset/natural_order.h"
#include "core/image/picture_file.h"
#include "core/image/segmentation.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

/// Pictures of one object by the number in their names.
using Numbered = std::map<int, fs::path>;
using Objects = std::map<std::string, Numbered, NaturalLess>;

/// An object counts as filling a picture when it spans this share of one side. Size-normalised views do,
/// whatever threshold finds them; a turntable seen from above leaves a margin.
constexpr double filling_span = 0.95;
/// The share of views that must be filled for a folder to count as cropped. One collection is photographed
/// one way, so all its objects are judged together; an object with dark edges alone would be misjudged.
constexpr double filled_views = 0.75;

/// "obj3__17.png" → obj3, 17.
std::optional<std::pair<std::string, int>> parse_name(const std::string& name) {
  constexpr std::string_view extension = ".png";
  const auto mark = name.rfind("__");
  if (!name.ends_with(extension) || mark == std::string::npos || mark == 0) return std::nullopt;
  const char* first = name.data() + mark + 2;
  const char* last = name.data() + name.size() - extension.size();
  int number = 0;
  const auto [end, error] = std::from_chars(first, last, number);
  if (error != std::errc() || end != last || first == last || number < 0) return std::nullopt;
  return std::pair(name.substr(0, mark), number);
}

Objects list_objects(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw FileError(folder, "is not a folder; give the one that holds the pictures");
  Objects objects;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.')) continue;
    const auto parsed = entry.is_regular_file() ? parse_name(name) : std::nullopt;
    if (!parsed)
      throw FileError(entry.path(),
                      "is not named as COIL pictures are (obj3__17.png); move it out of the folder");
    const auto [at, fresh] = objects[parsed->first].emplace(parsed->second, entry.path());
    if (!fresh)
      throw FileError(entry.path(), "and " + at->second.string() + " have the same number; remove one");
  }
  if (objects.empty()) throw FileError(folder, "holds no picture; COIL pictures are named obj3__17.png");
  return objects;
}

/// Evenly spaced numbers that together make a full turn, starting anywhere.
void check_turn(const std::string& object, const Numbered& pictures, const fs::path& folder,
                double degrees_per_step) {
  if (pictures.size() < 3)
    throw FileError(folder, "has " + std::to_string(pictures.size()) + " picture(s) of \"" + object +
                                "\"; a turn needs at least 3");
  const double step = 360.0 / (degrees_per_step * static_cast<double>(pictures.size()));
  const int first = pictures.begin()->first;
  std::size_t i = 0;
  for (const auto& [number, file] : pictures) {
    const double expected = first + static_cast<double>(i++) * step;
    if (std::abs(number - expected) < 1e-6) continue;
    throw FileError(file, "breaks the even turn of \"" + object + "\": " + std::to_string(pictures.size()) +
                              " pictures put number " + std::to_string(std::lround(expected)) +
                              " here; a picture is missing, or --angle is wrong");
  }
}

/// True if what stands out reaches from edge to edge.
bool fills(Segmenter& segmenter, const cv::Mat& image) {
  cv::Rect all;
  for (const Region& region : segmenter.segment(image)) all |= region.box;
  return all.width >= filling_span * image.cols || all.height >= filling_span * image.rows;
}

void check_same_kind(const cv::Mat& image, const cv::Mat& first, const fs::path& file) {
  if (image.size() == first.size() && image.type() == first.type()) return;
  throw FileError(file, "is " + std::to_string(image.cols) + "x" + std::to_string(image.rows) + " " +
                            cv::typeToString(image.type()) + ", the first picture of the object is " +
                            std::to_string(first.cols) + "x" + std::to_string(first.rows) + " " +
                            cv::typeToString(first.type()) + "; all views of an object must be alike");
}

/// Reads all pictures of one object and writes its set.
void import_object(const std::string& object, const Numbered& pictures, const fs::path& root, bool cropped,
                   const nlohmann::json& source, const CoilImportOptions& options,
                   const std::function<void()>& step) {
  if (fs::exists(root / object / "set.json") && !ImageSet::open(root / object).complete())
    fs::remove_all(root / object);  // what a broken-off import left
  ImageSetWriter writer(root, object, turntable_workspace(), source, {cropped, false});
  cv::Mat first;
  for (const auto& [number, file] : pictures) {
    step();
    const cv::Mat image = load_picture(file);
    if (first.empty()) first = image;
    check_same_kind(image, first, file);
    writer.add(image, {number * options.angle.degrees_per_step},
               {{"imported_name", file.filename().string()}});
  }
  writer.finish();
}

/// Share of the views an object fills. At most `looks` of each object are looked at, evenly spread.
double measure_filled(const Objects& objects, const std::function<void()>& step) {
  constexpr std::size_t looks = 12;
  Segmenter segmenter;
  std::size_t seen = 0;
  std::size_t filled = 0;
  for (const auto& [object, pictures] : objects) {
    const std::size_t stride = std::max<std::size_t>(1, pictures.size() / looks);
    std::size_t i = 0;
    for (const auto& [number, file] : pictures) {
      if (i++ % stride != 0) continue;
      step();
      ++seen;
      if (fills(segmenter, load_picture(file))) ++filled;
    }
  }
  return static_cast<double>(filled) / static_cast<double>(seen);
}

}  // namespace

ImportReport import_coil(const fs::path& folder, const fs::path& root, const CoilImportOptions& options,
                         const Progress& progress, std::stop_token stop) {
  if (!(options.angle.degrees_per_step > 0.0))
    throw std::invalid_argument("degrees per step is " + std::to_string(options.angle.degrees_per_step) +
                                ", must be above 0");
  const Objects objects = list_objects(folder);
  std::size_t total = 0;
  for (const auto& [object, pictures] : objects) {
    check_turn(object, pictures, folder, options.angle.degrees_per_step);
    total += pictures.size();
  }
  const auto check_stop = [&] {
    if (stop.stop_requested()) throw Interrupted("interrupted; the sets finished before are kept");
  };
  ImportReport report;
  report.filled = measure_filled(objects, check_stop);
  report.cropped = options.views == ViewKind::measured ? report.filled >= filled_views
                                                       : options.views == ViewKind::cropped;
  const nlohmann::json source = {{"imported_from", fs::absolute(folder).string()},
                                 {"naming", "coil"},
                                 {"degrees_per_step", options.angle.degrees_per_step},
                                 {"filled_views_share", report.filled}};
  std::size_t done = 0;
  for (const auto& [object, pictures] : objects) {
    import_object(object, pictures, root, report.cropped, source, options, [&] {
      check_stop();
      if (progress) progress({"importing", ++done, total});
    });
    report.sets.push_back({object, pictures.size()});
  }
  return report;
}

}  // namespace eigenpose
