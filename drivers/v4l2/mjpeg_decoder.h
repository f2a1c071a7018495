#pragma once

/// One MJPEG frame to pixels, as cameras send it.

#include <cstdint>
#include <span>

#include <opencv2/core.hpp>

#include "core/image/jpeg_reader.h"
#include "drivers/camera.h"

namespace eigenpose {

/// Keeps libjpeg's working memory between frames. Lives on one thread.
class MjpegDecoder {
 public:
  /// Decodes into `picture`: CV_8UC3 (BGR), or CV_8UC1 (brightness only, which is much cheaper). See
  /// JpegReader for what is borne: no Huffman tables, padding, stray bytes before a marker, no end marker.
  ///
  /// Two images of half the height in one buffer are the fields of an interlaced frame: the first has the
  /// upper line of each pair, unless its APP0 segment "AVI1" says that it has the lower (2).
  /// @return what is wrong with the frame; `picture` is then undefined.
  FrameFault decode(std::span<const std::uint8_t> frame, cv::Mat& picture);

 private:
  FrameFault decode_fields(std::span<const std::uint8_t> frame, cv::Mat& picture);

  JpegReader reader_;
};

}  // namespace eigenpose
