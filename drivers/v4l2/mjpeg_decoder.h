#pragma once

/// One MJPEG frame to pixels, with libjpeg-turbo itself.

#include <cstdint>
#include <memory>
#include <span>

#include <opencv2/core.hpp>

namespace eigenpose {

/// Keeps libjpeg's working memory between frames. Lives on one thread.
class MjpegDecoder {
 public:
  MjpegDecoder();
  ~MjpegDecoder();
  MjpegDecoder(const MjpegDecoder&) = delete;
  MjpegDecoder& operator=(const MjpegDecoder&) = delete;

  /// Decodes into `picture`: CV_8UC3 (BGR), or CV_8UC1 (luma only, which is much cheaper). Frames without
  /// Huffman tables, as many cameras send them, are read with the standard ones.
  /// @return false when the data is damaged, cut short, or of another size; `picture` is then undefined.
  bool decode(std::span<const std::uint8_t> jpeg, cv::Mat& picture);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eigenpose
