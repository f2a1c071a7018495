#include "core/image/picture_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <zlib.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using Bytes = std::span<const unsigned char>;

constexpr std::array<unsigned char, 8> png_signature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

std::uint32_t big_endian_32(Bytes bytes, std::size_t at) {
  return (std::uint32_t{bytes[at]} << 24) | (std::uint32_t{bytes[at + 1]} << 16) |
         (std::uint32_t{bytes[at + 2]} << 8) | std::uint32_t{bytes[at + 3]};
}

/// What is wrong with a PNG file, or nothing. A chunk is length, type, data, CRC of type and data.
std::optional<std::string> png_damage(Bytes bytes) {
  constexpr std::size_t frame = 12;  // bytes of a chunk beside its data
  std::size_t at = png_signature.size();
  while (bytes.size() - at >= frame) {
    const std::size_t length = big_endian_32(bytes, at);
    if (length > bytes.size() - at - frame) break;
    const auto crc = crc32(0L, bytes.data() + at + 4, static_cast<uInt>(length + 4));
    if (crc != big_endian_32(bytes, at + 8 + length))
      return "is damaged: wrong checksum at byte " + std::to_string(at);
    if (std::memcmp(bytes.data() + at + 4, "IEND", 4) == 0) return std::nullopt;
    at += length + frame;
  }
  return "is truncated: a PNG file without its end (" + std::to_string(bytes.size()) + " bytes)";
}

/// Whole numbers of a PNM header, comments skipped. The position after the last one is left in `at`.
std::optional<long> pnm_number(Bytes bytes, std::size_t& at) {
  while (at < bytes.size() && (std::isspace(bytes[at]) != 0 || bytes[at] == '#')) {
    if (bytes[at] == '#')
      while (at < bytes.size() && bytes[at] != '\n') ++at;
    else
      ++at;
  }
  long value = 0;
  const std::size_t first = at;
  while (at < bytes.size() && std::isdigit(bytes[at]) != 0 && value < 1'000'000)
    value = value * 10 + (bytes[at++] - '0');
  return at > first ? std::optional(value) : std::nullopt;
}

/// What is wrong with a binary PGM or PPM file, or nothing.
std::optional<std::string> pnm_damage(Bytes bytes) {
  std::size_t at = 2;
  const auto width = pnm_number(bytes, at);
  const auto height = pnm_number(bytes, at);
  const auto largest = pnm_number(bytes, at);
  if (!width || !height || !largest) return "is damaged: no PNM header";
  const long need = *width * *height * (bytes[1] == '6' ? 3 : 1) * (*largest > 255 ? 2 : 1);
  const long have = static_cast<long>(bytes.size()) - static_cast<long>(at) - 1;
  if (have >= need) return std::nullopt;
  return "is truncated: " + std::to_string(have) + " of " + std::to_string(need) + " bytes of picture";
}

/// A JPEG stream ends with the marker FF D9; some writers pad after it.
std::optional<std::string> jpeg_damage(Bytes bytes) {
  constexpr std::array<unsigned char, 2> end{0xff, 0xd9};
  const Bytes tail = bytes.last(std::min<std::size_t>(bytes.size(), 64));
  if (std::search(tail.begin(), tail.end(), end.begin(), end.end()) != tail.end()) return std::nullopt;
  return "is truncated: a JPEG file without its end";
}

std::optional<std::string> damage(Bytes bytes) {
  if (bytes.size() >= png_signature.size() &&
      std::equal(png_signature.begin(), png_signature.end(), bytes.begin()))
    return png_damage(bytes);
  if (bytes.size() >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8) return jpeg_damage(bytes);
  if (bytes.size() >= 2 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6')) return pnm_damage(bytes);
  return std::nullopt;
}

}  // namespace

cv::Mat decode_picture(Bytes bytes, const std::filesystem::path& name) {
  if (bytes.empty()) throw FileError(name, "is empty; put the picture there again");
  if (const auto trouble = damage(bytes))
    throw FileError(name, *trouble + "; copy or take the picture again");
  cv::Mat image;
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<unsigned char*>(bytes.data()));
    image = cv::imdecode(raw, cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH);
  } catch (const cv::Exception& failure) {
    throw FileError(name, "cannot be decoded: " + std::string(failure.what()));
  }
  if (image.empty())
    throw FileError(name, "is not a picture that can be read; PNG, JPEG, PGM, PPM and BMP can");
  if (image.type() != CV_8UC1 && image.type() != CV_8UC3 && image.type() != CV_16UC1)
    throw FileError(name, "has " + std::to_string(image.channels()) + " bands of " +
                              std::to_string(8 * image.elemSize1()) +
                              " bits; 8-bit grey or colour and 16-bit grey can be used");
  return image;
}

cv::Mat load_picture(const std::filesystem::path& file) {
  return decode_picture(read_file(file), file);
}

std::vector<unsigned char> encode_png(const cv::Mat& image) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_8UC3 && image.type() != CV_16UC1))
    throw std::invalid_argument("a view is 8-bit grey, 8-bit BGR or 16-bit grey and not empty; got type " +
                                cv::typeToString(image.type()) + ", " + std::to_string(image.cols) + "x" +
                                std::to_string(image.rows));
  std::vector<unsigned char> bytes;
  // Level 1 is 5 times faster than the default and a tenth larger.
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  return bytes;
}

}  // namespace eigenpose
