#include "core/dataset/turned_import.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <system_error>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/dataset/view_import.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

constexpr int margin = 12;  ///< pixels of background around a part, however it is turned

/// A part, in the middle of a square of background that it can turn in.
struct TurnedPart {
  std::string name;
  cv::Mat square;
  cv::Scalar background;
};

cv::Mat in_a_square(const cv::Mat& cut, const Background& background) {
  const int side = static_cast<int>(std::ceil(std::hypot(cut.cols, cut.rows))) + 2 * margin;
  cv::Mat square(side, side, cut.type(), background.color());
  cut.copyTo(square(cv::Rect((side - cut.cols) / 2, (side - cut.rows) / 2, cut.cols, cut.rows)));
  return square;
}

/// Nothing is begun that cannot be finished. @param names as given, or made.
void check_names(const std::vector<std::string>& names, std::size_t parts,
                 const std::filesystem::path& picture) {
  if (names.size() != parts)
    throw FileError(picture, "shows " + std::to_string(parts) + " parts, but " +
                                 std::to_string(names.size()) +
                                 " names are given; give one a part, from left to right");
  for (std::size_t i = 0; i < names.size(); ++i) {
    check_object_name(names[i]);
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]) !=
        names.begin() + static_cast<std::ptrdiff_t>(i))
      throw std::invalid_argument("two parts are named \"" + names[i] +
                                  "\"; every part is an object of its own");
  }
}

/// Which parts an earlier run has finished. @throws FileError where something else stands under a name.
std::vector<bool> finished_parts(const std::vector<std::string>& names, const std::filesystem::path& root,
                                 std::size_t views, const nlohmann::json& source) {
  ImportObject part;
  for (std::size_t v = 0; v < views; ++v)
    part.views.push_back({{}, {360.0 * static_cast<double>(v) / static_cast<double>(views)}});
  std::vector<bool> finished;
  for (const std::string& name : names) {
    part.name = name;
    finished.push_back(import_finished(part, root, turntable_workspace(), source));
    std::error_code unknown;  // where it cannot be looked up, writing it says why
    if (!finished.back() && std::filesystem::exists(root / name, unknown))
      throw FileError(root / name, "stands there already; remove it or give the part another name");
  }
  return finished;
}

/// Writes the image set of one part; leaves nothing where it fails. @param step is called before each view.
void write_turns(const TurnedPart& part, const std::filesystem::path& root, const nlohmann::json& source,
                 std::size_t views, const std::function<void(std::size_t)>& step) {
  const cv::Mat& square = part.square;
  ImageSetWriter writer(root, part.name, turntable_workspace(), source, {.sync_every_view = false});
  try {
    const auto middle = 0.5F * static_cast<float>(square.cols - 1);
    for (std::size_t v = 0; v < views; ++v) {
      step(v);
      const double degrees = 360.0 * static_cast<double>(v) / static_cast<double>(views);
      cv::Mat turned;
      cv::warpAffine(square, turned, cv::getRotationMatrix2D({middle, middle}, degrees, 1.0), square.size(),
                     cv::INTER_LINEAR, cv::BORDER_CONSTANT, part.background);
      writer.add(turned, {degrees});
    }
    writer.finish();
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove_all(root / part.name, ignored);
    throw;
  }
}

}  // namespace

std::vector<std::string> import_turned(const std::filesystem::path& picture,
                                       const std::filesystem::path& root, const TurnedImportOptions& options,
                                       const Progress& progress, const std::stop_token& stop) {
  if (options.views < 2 || options.views > 3600)
    throw std::invalid_argument("a turn of " + std::to_string(options.views) +
                                " views: allowed are 2 to 3600");
  const cv::Mat image = load_picture(picture);
  if (image.depth() != CV_8U)
    throw FileError(picture, "has 16 bits a pixel; parts are turned in 8-bit pictures");
  Segmenter segmenter(options.segmentation);
  const auto regions = segmenter.segment(image);
  std::vector<std::size_t> parts;
  for (std::size_t i = 0; i < regions.size(); ++i)
    if (!regions[i].touches_border) parts.push_back(i);
  if (parts.empty())
    throw FileError(picture, "shows no part on a dark background that is clear of the picture's border");
  std::vector<std::string> names = options.names;
  if (names.empty())
    for (std::size_t i = 0; i < parts.size(); ++i) names.push_back("part" + std::to_string(i + 1));
  check_names(names, parts.size(), picture);

  std::error_code no_working_folder;
  const std::filesystem::path from = std::filesystem::absolute(picture, no_working_folder);
  const nlohmann::json source = {{"imported_from", (no_working_folder ? picture : from).string()},
                                 {"turned", true}};
  const std::vector<bool> finished = finished_parts(names, root, options.views, source);
  const Background& background = segmenter.background();
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (finished[p]) continue;
    const TurnedPart part{names[p], in_a_square(segmenter.cut_out(image, parts[p]), background),
                          background.color()};
    write_turns(part, root, source, options.views, [&](std::size_t view) {
      if (stop.stop_requested()) throw Interrupted("interrupted; the sets finished before are kept");
      if (progress) progress({"turning", p * options.views + view + 1, parts.size() * options.views});
    });
  }
  return names;
}

}  // namespace eigenpose
