#pragma once

/// The camera formats we read, and pictures made from them.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "drivers/camera.h"
#include "drivers/v4l2/luma.h"

namespace eigenpose {

enum class PixelFormat { grey, yuyv, nv12, mjpeg };

/// "GREY", "YUYV", "NV12", "MJPG": V4L2's four letters.
std::string name_of(PixelFormat format);
std::optional<PixelFormat> pixel_format_from_name(const std::string& name);
/// V4L2's code, and back. MJPEG and JPEG are read alike.
std::uint32_t fourcc_of(PixelFormat format);
std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc);
/// "YUYV" from any code, known to us or not.
std::string text_of_fourcc(std::uint32_t fourcc);

/// Where the pixels lie in a buffer.
struct BufferLayout {
  PixelFormat format = PixelFormat::yuyv;
  int width = 0;                         ///< pixels; even for YUYV and NV12
  int height = 0;                        ///< pixels; even for NV12
  std::size_t stride = 0;                ///< bytes from row to row; meaningless for MJPEG
  LumaRange range = LumaRange::limited;  ///< of YUYV, NV12 and GREY

  /// The bytes a whole picture takes; 0 for MJPEG, which may take any number.
  [[nodiscard]] std::size_t bytes() const;
};

class MjpegDecoder;

/// What is made of a buffer.
enum class PictureKind {
  grey,  ///< CV_8UC1: luma alone is read
  color  ///< CV_8UC3, BGR
};

/// Makes pictures of one layout. Lives on one thread.
class PixelDecoder {
 public:
  /// GREY cannot give colour (std::invalid_argument).
  PixelDecoder(const BufferLayout& layout, PictureKind kind);
  ~PixelDecoder();

  /// CV_8UC3 or CV_8UC1.
  [[nodiscard]] int picture_type() const { return kind_ == PictureKind::color ? CV_8UC3 : CV_8UC1; }
  /// Fills `picture`, which has the layout's size and `picture_type`.
  /// @return what is wrong with the buffer; `picture` is then undefined.
  FrameFault decode(std::span<const std::uint8_t> buffer, cv::Mat& picture);

 private:
  void decode_luma(const std::uint8_t* data, cv::Mat& picture) const;
  void decode_limited_color(std::span<const std::uint8_t> buffer, cv::Mat& picture) const;
  void decode_full_color(const std::uint8_t* data, cv::Mat& picture);

  BufferLayout layout_;
  PictureKind kind_;
  cv::Mat ycrcb_;                        ///< CV_8UC3, for colour of full range only
  std::unique_ptr<MjpegDecoder> mjpeg_;  ///< for MJPEG only
};

}  // namespace eigenpose
