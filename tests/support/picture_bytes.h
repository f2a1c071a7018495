#pragma once

/// Writers of picture files, byte by byte as the specifications have them, so that a test can write what no
/// library would.

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>
#include <zlib.h>

#include "core/base/error.h"
#include "core/image/picture_file.h"

namespace eigenpose::test {

using ByteList = std::vector<unsigned char>;

inline ByteList bytes_of(std::string_view text) {
  return {text.begin(), text.end()};
}

inline ByteList operator+(ByteList left, const ByteList& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

/// The first `count` bytes.
inline ByteList cut(const ByteList& bytes, std::size_t count) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)};
}

/// `size` bytes of a number, least or most significant first.
inline ByteList little(std::uint64_t value, int size) {
  ByteList bytes;
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<unsigned char>(value >> (8 * i)));
  return bytes;
}
inline ByteList big(std::uint64_t value, int size) {
  const ByteList bytes = little(value, size);
  return {bytes.rbegin(), bytes.rend()};
}

/// What the reader says; "accepted" when it returns a picture.
inline std::string refusal(const ByteList& bytes) {
  try {
    decode_picture(bytes, "view");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

/// All samples in reading order, BGR turned to RGB, behind the type: {CV_8UC3, r, g, b, r, …}.
inline std::vector<int> samples_of(const ByteList& bytes) {
  const cv::Mat picture = decode_picture(bytes, "view");
  std::vector<int> samples{picture.type()};
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x)
      for (int c = 0; c < picture.channels(); ++c) {
        const int at = x * picture.channels() + (picture.channels() == 3 ? 2 - c : c);
        samples.push_back(picture.depth() == CV_16U ? picture.ptr<std::uint16_t>(y)[at]
                                                    : picture.ptr<std::uint8_t>(y)[at]);
      }
  return samples;
}

/// zlib's format, which PNG and TIFF's Deflate share.
inline ByteList deflated(const ByteList& bytes) {
  uLongf size = compressBound(bytes.size());
  ByteList result(size);
  compress2(result.data(), &size, bytes.data(), bytes.size(), 9);
  result.resize(size);
  return result;
}

inline ByteList png_chunk(std::string_view type, const ByteList& data) {
  const ByteList named = bytes_of(type) + data;
  return big(data.size(), 4) + named + big(crc32(0L, named.data(), static_cast<uInt>(named.size())), 4);
}

struct PngParts {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  int bits = 8;
  int color_type = 0;      ///< 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA
  ByteList rows{};         ///< each begins with its filter
  ByteList before_data{};  ///< chunks between IHDR and IDAT
  int interlace = 0;
};

inline ByteList png_of(const PngParts& parts) {
  const ByteList header =
      big(parts.width, 4) + big(parts.height, 4) +
      ByteList{static_cast<unsigned char>(parts.bits), static_cast<unsigned char>(parts.color_type), 0, 0,
               static_cast<unsigned char>(parts.interlace)};
  return bytes_of("\x89PNG\r\n\x1a\n") + png_chunk("IHDR", header) + parts.before_data +
         png_chunk("IDAT", deflated(parts.rows)) + png_chunk("IEND", {});
}

/// One entry of a TIFF directory: SHORT values, LONG ones, or bytes.
struct TiffEntry {
  int tag = 0;
  std::vector<std::uint32_t> values{};
  int type = 3;  ///< 1 BYTE, 3 SHORT, 4 LONG, 7 UNDEFINED
};

/// A TIFF file: header, `data` at byte 8, values that need room, the directory. Entries in ascending order.
inline ByteList tiff_of(const std::vector<TiffEntry>& entries, const ByteList& data,
                        bool big_endian = false) {
  const auto number = [&](std::uint64_t value, int size) {
    return big_endian ? big(value, size) : little(value, size);
  };
  ByteList body = data;
  ByteList directory = number(entries.size(), 2);
  for (const TiffEntry& entry : entries) {
    const int size = entry.type == 3 ? 2 : (entry.type == 4 ? 4 : 1);
    ByteList values;
    for (const std::uint32_t value : entry.values) values = values + number(value, size);
    directory = directory + number(static_cast<std::uint64_t>(entry.tag), 2) +
                number(static_cast<std::uint64_t>(entry.type), 2) + number(entry.values.size(), 4);
    if (values.size() <= 4) {
      values.resize(4);
      directory = directory + values;
    } else {
      directory = directory + number(8 + body.size(), 4);
      body = body + values;
    }
  }
  return bytes_of(big_endian ? "MM" : "II") + number(42, 2) + number(8 + body.size(), 4) + body + directory +
         number(0, 4);
}

/// EXIF data that holds an orientation and nothing else.
inline ByteList exif_of(std::uint32_t orientation, bool big_endian = false) {
  return tiff_of({{274, {orientation}}}, {}, big_endian);
}

/// How the rows {1, 2, 3}, {4, 5, 6} of a file are to be seen under an orientation of EXIF or TIFF 6.0: where
/// the first row and the first column of the file lie in what was photographed.
inline cv::Mat as_seen(int orientation) {
  switch (orientation) {
    case 2:
      return (cv::Mat_<std::uint8_t>(2, 3) << 3, 2, 1, 6, 5, 4);  // top, right
    case 3:
      return (cv::Mat_<std::uint8_t>(2, 3) << 6, 5, 4, 3, 2, 1);  // bottom, right
    case 4:
      return (cv::Mat_<std::uint8_t>(2, 3) << 4, 5, 6, 1, 2, 3);  // bottom, left
    case 5:
      return (cv::Mat_<std::uint8_t>(3, 2) << 1, 4, 2, 5, 3, 6);  // left, top
    case 6:
      return (cv::Mat_<std::uint8_t>(3, 2) << 4, 1, 5, 2, 6, 3);  // right, top
    case 7:
      return (cv::Mat_<std::uint8_t>(3, 2) << 6, 3, 5, 2, 4, 1);  // right, bottom
    case 8:
      return (cv::Mat_<std::uint8_t>(3, 2) << 3, 6, 2, 5, 1, 4);  // left, bottom
    default:
      return (cv::Mat_<std::uint8_t>(2, 3) << 1, 2, 3, 4, 5, 6);
  }
}

}  // namespace eigenpose::test
