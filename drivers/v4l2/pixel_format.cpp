#include "drivers/v4l2/pixel_format.h"

#include <array>
#include <stdexcept>

#include <linux/videodev2.h>
#include <opencv2/imgproc.hpp>

#include "drivers/v4l2/mjpeg_decoder.h"

namespace eigenpose {
namespace {

struct Known {
  PixelFormat format;
  const char* name;
  std::uint32_t fourcc;
};
constexpr std::array<Known, 5> known_formats{{{PixelFormat::grey, "GREY", V4L2_PIX_FMT_GREY},
                                              {PixelFormat::yuyv, "YUYV", V4L2_PIX_FMT_YUYV},
                                              {PixelFormat::nv12, "NV12", V4L2_PIX_FMT_NV12},
                                              {PixelFormat::mjpeg, "MJPG", V4L2_PIX_FMT_MJPEG},
                                              {PixelFormat::mjpeg, "JPEG", V4L2_PIX_FMT_JPEG}}};

const Known& known(PixelFormat format) {
  return known_formats.at(static_cast<std::size_t>(format));
}

}  // namespace

std::string name_of(PixelFormat format) {
  return known(format).name;
}

std::optional<PixelFormat> pixel_format_from_name(const std::string& name) {
  if (name == "MJPEG") return PixelFormat::mjpeg;
  for (const Known& entry : known_formats) {
    if (name == entry.name) return entry.format;
  }
  return std::nullopt;
}

std::uint32_t fourcc_of(PixelFormat format) {
  return known(format).fourcc;
}

std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc) {
  for (const Known& entry : known_formats) {
    if (fourcc == entry.fourcc) return entry.format;
  }
  return std::nullopt;
}

std::string text_of_fourcc(std::uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>((fourcc >> shift) & 0x7f);
    text += letter >= ' ' ? letter : '?';
  }
  return text;
}

std::size_t BufferLayout::bytes() const {
  const std::size_t plane = stride * static_cast<std::size_t>(height);
  switch (format) {
    case PixelFormat::grey:
    case PixelFormat::yuyv:
      return plane;
    case PixelFormat::nv12:
      return plane + plane / 2;
    case PixelFormat::mjpeg:
      return 0;
  }
  return 0;
}

PixelDecoder::PixelDecoder(const BufferLayout& layout, PictureKind kind) : layout_(layout), kind_(kind) {
  if (kind == PictureKind::color && layout.format == PixelFormat::grey)
    throw std::invalid_argument("GREY has no colour to decode");
  if (layout.format == PixelFormat::mjpeg)
    mjpeg_ = std::make_unique<MjpegDecoder>();
  else if (kind == PictureKind::color && layout.range == LumaRange::full)
    ycrcb_.create(layout.height, layout.width, CV_8UC3);
}

PixelDecoder::~PixelDecoder() = default;

FrameFault PixelDecoder::decode(std::span<const std::uint8_t> buffer, cv::Mat& picture) {
  if (layout_.format == PixelFormat::mjpeg) return mjpeg_->decode(buffer, picture);
  if (buffer.size() < layout_.bytes()) return FrameFault::too_short;
  if (kind_ == PictureKind::grey)
    decode_luma(buffer.data(), picture);
  else if (layout_.range == LumaRange::limited)
    decode_limited_color(buffer, picture);
  else
    decode_full_color(buffer.data(), picture);
  return FrameFault::none;
}

void PixelDecoder::decode_luma(const std::uint8_t* data, cv::Mat& picture) const {
  const auto pixels = static_cast<std::size_t>(layout_.width);
  for (int row = 0; row < layout_.height; ++row) {
    const std::uint8_t* from = data + static_cast<std::size_t>(row) * layout_.stride;
    if (layout_.format == PixelFormat::yuyv) {
      luma_of_yuyv(from, picture.ptr(row), pixels, layout_.range);
    } else {
      copy_luma(from, picture.ptr(row), pixels, layout_.range);
    }
  }
}

void PixelDecoder::decode_limited_color(std::span<const std::uint8_t> buffer, cv::Mat& picture) const {
  // OpenCV only reads through these headers. Its YUYV and NV12 are of limited range.
  auto* data = const_cast<std::uint8_t*>(buffer.data());
  if (layout_.format == PixelFormat::yuyv) {
    const cv::Mat yuyv(layout_.height, layout_.width, CV_8UC2, data, layout_.stride);
    cv::cvtColor(yuyv, picture, cv::COLOR_YUV2BGR_YUYV);
  } else {
    const cv::Mat luma(layout_.height, layout_.width, CV_8UC1, data, layout_.stride);
    const cv::Mat chroma(layout_.height / 2, layout_.width / 2, CV_8UC2,
                         data + layout_.stride * static_cast<std::size_t>(layout_.height), layout_.stride);
    cv::cvtColorTwoPlane(luma, chroma, picture, cv::COLOR_YUV2BGR_NV12);
  }
}

void PixelDecoder::decode_full_color(const std::uint8_t* data, cv::Mat& picture) {
  const bool packed = layout_.format == PixelFormat::yuyv;
  const auto row_at = [&](int row) { return data + static_cast<std::size_t>(row) * layout_.stride; };
  for (int row = 0; row < layout_.height; ++row) {
    const std::uint8_t* luma = row_at(row);
    // YUYV: Y U Y V …; NV12: U V … of two rows, behind all luma.
    const std::uint8_t* chroma = packed ? luma + 1 : row_at(layout_.height + row / 2);
    std::uint8_t* to = ycrcb_.ptr(row);
    for (int column = 0; column < layout_.width; column += 2) {
      const std::uint8_t u = chroma[0];
      const std::uint8_t v = chroma[packed ? 2 : 1];
      for (int pixel = 0; pixel < 2; ++pixel, to += 3) {
        to[0] = *luma;
        to[1] = v;
        to[2] = u;
        luma += packed ? 2 : 1;
      }
      chroma += packed ? 4 : 2;
    }
  }
  // The colours of JPEG: BT.601 of full range.
  cv::cvtColor(ycrcb_, picture, cv::COLOR_YCrCb2BGR);
}

}  // namespace eigenpose
