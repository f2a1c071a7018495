#include "daemon/api/frame_jpeg.h"

#include <vector>

#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

constexpr int quality = 85;

}  // namespace

std::shared_ptr<const std::string> FrameJpeg::of(const Frame& frame) {
  const std::lock_guard lock(mutex_);
  if (bytes_ && frame.sequence == sequence_ && frame.exposure_start == exposure_start_) return bytes_;
  cv::Mat image = frame.image;
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 256.0);
  const std::vector<unsigned char> encoded = encode_jpeg(image, quality);
  bytes_ = std::make_shared<const std::string>(encoded.begin(), encoded.end());
  sequence_ = frame.sequence;
  exposure_start_ = frame.exposure_start;
  return bytes_;
}

}  // namespace eigenpose
