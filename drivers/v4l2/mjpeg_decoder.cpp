#include "drivers/v4l2/mjpeg_decoder.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace eigenpose {
namespace {

using Bytes = std::span<const std::uint8_t>;

/// Pixels alone count: a missing end marker changes none.
FrameFault frame_fault(JpegFault fault) {
  switch (fault) {
    case JpegFault::none:
    case JpegFault::missing_end:
      return FrameFault::none;
    case JpegFault::no_image:
      return FrameFault::no_image;
    case JpegFault::unsupported:
      return FrameFault::unsupported;
    case JpegFault::cut_short:
    case JpegFault::missing_scans:
      return FrameFault::cut_short;
    case JpegFault::damaged_data:
    case JpegFault::stray_bytes:
      return FrameFault::damaged_data;
  }
  return FrameFault::damaged_data;
}

/// Whether the first field has the lower line of each pair: polarity 2 in the APP0 segment of Open-DML MJPEG,
/// FF E0, length, "AVI1", polarity. Cameras put it first.
bool lower_lines_first(Bytes frame) {
  constexpr std::string_view name = "AVI1";
  constexpr std::size_t name_at = 6;  // behind FF D8 FF E0 and the length
  return frame.size() > name_at + name.size() && frame[2] == 0xff && frame[3] == 0xe0 &&
         std::equal(name.begin(), name.end(), frame.begin() + name_at) && frame[name_at + name.size()] == 2;
}

}  // namespace

FrameFault MjpegDecoder::decode(Bytes frame, cv::Mat& picture) {
  if (frame.empty()) return FrameFault::too_short;
  if (const JpegFault fault = reader_.open(frame); fault != JpegFault::none) return frame_fault(fault);
  const auto rows = static_cast<std::uint32_t>(picture.rows);
  if (reader_.header().width != static_cast<std::uint32_t>(picture.cols)) return FrameFault::wrong_size;
  if (rows % 2 == 0 && reader_.header().height == rows / 2) return decode_fields(frame, picture);
  if (reader_.header().height != rows) return FrameFault::wrong_size;
  return frame_fault(reader_.decode(picture));
}

FrameFault MjpegDecoder::decode_fields(Bytes frame, cv::Mat& picture) {
  // Every second row of the picture, from `first` on.
  const auto field = [&](std::size_t first) {
    return cv::Mat(picture.rows / 2, picture.cols, picture.type(), picture.data + first * picture.step[0],
                   2 * picture.step[0]);
  };
  const std::size_t first = lower_lines_first(frame) ? 1 : 0;
  cv::Mat lines = field(first);
  if (const FrameFault fault = frame_fault(reader_.decode(lines)); fault != FrameFault::none) return fault;

  constexpr std::array<std::uint8_t, 2> start{0xff, 0xd8};
  const Bytes behind = frame.subspan(reader_.bytes_read());
  const auto second = std::search(behind.begin(), behind.end(), start.begin(), start.end());
  if (second == behind.end()) return FrameFault::cut_short;
  if (const JpegFault fault = reader_.open(Bytes(second, behind.end())); fault != JpegFault::none)
    return frame_fault(fault);
  lines = field(1 - first);
  if (reader_.header().width != static_cast<std::uint32_t>(lines.cols) ||
      reader_.header().height != static_cast<std::uint32_t>(lines.rows))
    return FrameFault::wrong_size;
  return frame_fault(reader_.decode(lines));
}

}  // namespace eigenpose
