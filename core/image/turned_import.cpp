#include "core/image/turned_import.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/image/image_set.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

constexpr int margin = 12;  ///< pixels of background around a part, however it is turned

/// The part in the middle of a square of background that it can turn in.
cv::Mat in_a_square(const cv::Mat& cut, const Background& background) {
  const int side = static_cast<int>(std::ceil(std::hypot(cut.cols, cut.rows))) + 2 * margin;
  cv::Mat square(side, side, cut.type(), background.color());
  cut.copyTo(square(cv::Rect((side - cut.cols) / 2, (side - cut.rows) / 2, cut.cols, cut.rows)));
  return square;
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
  if (names.size() != parts.size())
    throw FileError(picture, "shows " + std::to_string(parts.size()) + " parts, but " +
                                 std::to_string(names.size()) +
                                 " names are given; give one a part, from left to right");

  for (std::size_t p = 0; p < parts.size(); ++p) {
    const Background& background = segmenter.background();
    const cv::Mat square = in_a_square(segmenter.cut_out(image, parts[p]), background);
    const auto middle = 0.5F * static_cast<float>(square.cols - 1);
    const nlohmann::json source = {{"imported_from", std::filesystem::absolute(picture).string()},
                                   {"turned", true}};
    ImageSetWriter writer(root, names[p], turntable_workspace(), source, {.sync_every_view = false});
    for (std::size_t v = 0; v < options.views; ++v) {
      if (stop.stop_requested()) throw Interrupted("interrupted; the sets finished before are kept");
      const double degrees = 360.0 * static_cast<double>(v) / static_cast<double>(options.views);
      cv::Mat turned;
      cv::warpAffine(square, turned, cv::getRotationMatrix2D({middle, middle}, degrees, 1.0), square.size(),
                     cv::INTER_LINEAR, cv::BORDER_CONSTANT, background.color());
      writer.add(turned, {degrees});
      if (progress) progress({"turning", p * options.views + v + 1, parts.size() * options.views});
    }
    writer.finish();
  }
  return names;
}

}  // namespace eigenpose
