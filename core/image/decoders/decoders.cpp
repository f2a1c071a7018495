#include "core/image/decoders/decoders.h"

#include <limits>

namespace eigenpose::decoders {
namespace {

template <typename Sample>
void multiply_by_opacity(const cv::Mat& image, cv::Mat& result) {
  constexpr std::uint32_t full = std::numeric_limits<Sample>::max();
  const int channels = result.channels();
  for (int y = 0; y < image.rows; ++y) {
    const Sample* from = image.ptr<Sample>(y);
    auto* to = result.ptr<Sample>(y);
    for (int x = 0; x < image.cols; ++x, from += channels + 1)
      for (int c = 0; c < channels; ++c) *to++ = static_cast<Sample>(rescaled(from[c], full, from[channels]));
  }
}

}  // namespace

void refuse_damaged(const std::string& what) {
  throw PictureError("is damaged: " + what + "; copy or take the picture again");
}

void refuse_truncated(const std::string& what) {
  throw PictureError("is truncated: " + what + "; copy or take the picture again");
}

void refuse_unsupported(const std::string& what) {
  throw PictureError(what + "; save it as 8-bit grey or colour or as 16-bit grey PNG");
}

void check_size(std::int64_t width, std::int64_t height) {
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width <= 0 || height <= 0) refuse_damaged("its size is " + size + " pixels");
  if (static_cast<std::uint64_t>(width) > most_pixels ||
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > most_pixels)
    throw PictureError("is too large: it has " + size + " pixels; at most " +
                       std::to_string(most_pixels / 1'000'000) + " million are decoded, scale it down");
}

cv::Mat upright(const cv::Mat& pixels, int orientation) {
  cv::Mat result = pixels;
  if (orientation >= 5 && orientation <= 8) cv::transpose(pixels, result);
  switch (orientation) {
    case 2:
    case 6:  // turn by 90° clockwise: transpose, then mirror left and right
      cv::flip(result, result, 1);
      break;
    case 3:
    case 7:
      cv::flip(result, result, -1);
      break;
    case 4:
    case 8:
      cv::flip(result, result, 0);
      break;
    default:
      break;
  }
  return result;
}

cv::Mat over_black(const cv::Mat& image) {
  cv::Mat result(image.rows, image.cols, CV_MAKETYPE(image.depth(), image.channels() - 1));
  if (image.depth() == CV_16U)
    multiply_by_opacity<std::uint16_t>(image, result);
  else
    multiply_by_opacity<std::uint8_t>(image, result);
  return result;
}

cv::Mat to_8_bits(const cv::Mat& image) {
  cv::Mat result(image.rows, image.cols, CV_MAKETYPE(CV_8U, image.channels()));
  const int samples = image.cols * image.channels();
  for (int y = 0; y < image.rows; ++y)
    for (int i = 0; i < samples; ++i)
      result.ptr<std::uint8_t>(y)[i] =
          static_cast<std::uint8_t>(rescaled(image.ptr<std::uint16_t>(y)[i], 65535, 255));
  return result;
}

}  // namespace eigenpose::decoders
