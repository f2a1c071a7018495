/// Windows and OS/2 bitmaps, as the BITMAPFILEHEADER, BITMAPCOREHEADER, BITMAPINFOHEADER, V4 and V5 headers
/// describe them.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <vector>

#include "core/image/decoders/decoders.h"

namespace eigenpose::decoders {
namespace {

enum BmpCompression : std::uint32_t { rgb = 0, rle8 = 1, rle4 = 2, bit_fields = 3, alpha_bit_fields = 6 };

std::uint32_t little_16(Bytes bytes, std::size_t at) {
  return bytes[at] | std::uint32_t{bytes[at + 1]} << 8U;
}
std::uint32_t little_32(Bytes bytes, std::size_t at) {
  return little_16(bytes, at) | little_16(bytes, at + 2) << 16U;
}

struct BmpHeader {
  std::uint32_t size =
      0;  ///< of the header behind the file header: 12 is OS/2's, 40 Windows', 108 V4, 124 V5
  int width = 0;
  int height = 0;
  bool top_down = false;
  std::uint32_t bits = 0;
  std::uint32_t compression = rgb;
  std::array<std::uint32_t, 4> masks{};  ///< red, green, blue, opacity (0: opaque)
  std::vector<cv::Vec3b> palette;        ///< BGR
  std::size_t pixels_at = 0;

  [[nodiscard]] std::size_t row_bytes() const {
    return (static_cast<std::size_t>(width) * bits + 31) / 32 * 4;
  }
};

void need(Bytes file, std::size_t bytes, const char* what) {
  if (file.size() < bytes) refuse_truncated(std::string("its ") + what + " is cut off");
}

void read_size(Bytes file, BmpHeader& header) {
  need(file, 18, "header");
  header.pixels_at = little_32(file, 10);
  header.size = little_32(file, 14);
  constexpr std::array<std::uint32_t, 8> known{12, 16, 40, 52, 56, 64, 108, 124};
  if (std::find(known.begin(), known.end(), header.size) == known.end())
    refuse_damaged("its header has " + std::to_string(header.size) + " bytes, which no bitmap has");
  need(file, 14 + header.size, "header");
  std::int64_t width = 0;
  std::int64_t height = 0;
  if (header.size == 12) {
    width = little_16(file, 18);
    height = little_16(file, 20);
    header.bits = little_16(file, 24);
  } else {
    width = static_cast<std::int32_t>(little_32(file, 18));
    height = static_cast<std::int32_t>(little_32(file, 22));
    header.bits = little_16(file, 28);
    header.compression = header.size >= 40 ? little_32(file, 30) : 0;
  }
  header.top_down = height < 0;
  check_size(width, std::abs(height));
  header.width = static_cast<int>(width);
  header.height = static_cast<int>(std::abs(height));
}

void check_kind(const BmpHeader& header) {
  const auto is_one_of = [](std::uint32_t value, std::initializer_list<std::uint32_t> list) {
    return std::find(list.begin(), list.end(), value) != list.end();
  };
  if (header.compression == 4 || header.compression == 5)
    refuse_unsupported("is a BMP file with a JPEG or PNG file inside");
  bool fits = false;
  switch (header.compression) {
    case rgb:
      fits = is_one_of(header.bits, {1, 2, 4, 8, 16, 24, 32});
      break;
    case rle8:
      fits = header.bits == 8 && !header.top_down;
      break;
    case rle4:
      fits = header.bits == 4 && !header.top_down;
      break;
    case bit_fields:
    case alpha_bit_fields:
      fits = is_one_of(header.bits, {16, 32}) && header.size != 64;
      break;
    default:
      break;
  }
  if (!fits)
    refuse_damaged("it has " + std::to_string(header.bits) + " bits a pixel with compression " +
                   std::to_string(header.compression) + (header.top_down ? " from the top down" : ""));
}

/// Where the palette begins: behind the header and the masks that follow a header of 40 bytes.
std::size_t read_masks(Bytes file, BmpHeader& header) {
  const std::size_t end = 14 + header.size;
  header.masks = header.bits == 16 ? std::array<std::uint32_t, 4>{0x7c00, 0x03e0, 0x001f, 0}
                                   : std::array<std::uint32_t, 4>{0xff0000, 0xff00, 0xff, 0};
  if (header.compression != bit_fields && header.compression != alpha_bit_fields) return end;
  const bool outside = header.size == 40;
  const bool opacity = outside ? header.compression == alpha_bit_fields : header.size >= 56;
  const std::size_t count = opacity ? 4 : 3;
  need(file, 54 + 4 * count, "bit masks");
  for (std::size_t i = 0; i < count; ++i) header.masks.at(i) = little_32(file, 54 + 4 * i);
  std::uint32_t seen = 0;
  for (const std::uint32_t mask : header.masks) {
    const std::uint32_t low = mask == 0 ? 0 : mask >> std::countr_zero(mask);
    if ((low & (low + 1)) != 0 || (seen & mask) != 0) refuse_damaged("its bit masks have gaps or overlap");
    seen |= mask;
  }
  return outside ? end + 4 * count : end;
}

void read_palette(Bytes file, std::size_t at, BmpHeader& header) {
  if (header.bits > 8) return;
  const std::size_t entry = header.size == 12 ? 3 : 4;
  const std::size_t most = std::size_t{1} << header.bits;
  std::size_t colors = header.size >= 40 ? little_32(file, 46) : 0;
  if (colors == 0) colors = most;
  if (colors > most) refuse_damaged("its palette has " + std::to_string(colors) + " colours");
  // OS/2's header gives no count: what lies before the pixels is there.
  if (header.size < 40 && header.pixels_at > at) colors = std::min(colors, (header.pixels_at - at) / entry);
  need(file, at + colors * entry, "palette");
  for (std::size_t i = 0; i < colors; ++i) {
    const unsigned char* color = file.data() + at + i * entry;
    header.palette.emplace_back(color[0], color[1], color[2]);
  }
  if (header.pixels_at < at + colors * entry) refuse_damaged("its pixels begin inside its palette");
}

/// Palette indices of run-length encoded pixels. Pixels that are skipped have index 0.
class RunLengthReader {
 public:
  RunLengthReader(Bytes data, const BmpHeader& header)
      : data_(data), header_(header), indices_(header.height, header.width, CV_8UC1, cv::Scalar(0)) {}

  cv::Mat read() {
    for (bool more = true; more;) {
      const std::uint32_t count = next();
      const std::uint32_t value = next();
      if (count > 0)
        put_run(count, value);
      else if (value > 2)
        put_literal(value);
      else
        more = escape(value);
    }
    return indices_;
  }

 private:
  unsigned char next() {
    if (at_ >= data_.size()) refuse_truncated("its pixels end without the end mark");
    return data_[at_++];
  }
  /// @return false at the end of the bitmap.
  bool escape(std::uint32_t code) {
    if (code == 1) return false;
    if (code == 0) {
      x_ = 0;
      ++y_;
    } else {
      x_ += next();
      y_ += next();
    }
    return true;
  }
  void put(std::uint32_t index) {
    if (x_ >= header_.width || y_ >= header_.height) refuse_damaged("a run of its pixels leaves the picture");
    indices_.at<std::uint8_t>(header_.height - 1 - y_, x_++) = static_cast<std::uint8_t>(index);
  }
  void put_run(std::uint32_t count, std::uint32_t value) {
    for (std::uint32_t i = 0; i < count; ++i)
      put(header_.compression == rle8 ? value : (i % 2 == 0 ? value >> 4U : value & 15U));
  }
  void put_literal(std::uint32_t count) {
    const std::uint32_t bytes = header_.compression == rle8 ? count : (count + 1) / 2;
    for (std::uint32_t i = 0; i < bytes; ++i) {
      const std::uint32_t value = next();
      if (header_.compression == rle8) {
        put(value);
      } else {
        put(value >> 4U);
        if (2 * i + 1 < count) put(value & 15U);
      }
    }
    if (bytes % 2 != 0) next();  // literals end on words
  }

  Bytes data_;
  const BmpHeader& header_;
  cv::Mat indices_;
  std::size_t at_ = 0;
  int x_ = 0;
  int y_ = 0;  ///< from the bottom
};

/// The row of the file that row `y` of the picture is.
const unsigned char* row_of(Bytes data, const BmpHeader& header, int y) {
  const int line = header.top_down ? y : header.height - 1 - y;
  return data.data() + static_cast<std::size_t>(line) * header.row_bytes();
}

cv::Mat palette_indices(Bytes data, const BmpHeader& header) {
  if (header.compression != rgb) return RunLengthReader(data, header).read();
  cv::Mat indices(header.height, header.width, CV_8UC1);
  const std::uint32_t in_byte = 8 / header.bits;
  for (int y = 0; y < header.height; ++y) {
    const unsigned char* row = row_of(data, header, y);
    auto* to = indices.ptr<std::uint8_t>(y);
    for (std::uint32_t x = 0; x < static_cast<std::uint32_t>(header.width); ++x)
      to[x] = static_cast<std::uint8_t>((row[x / in_byte] >> (8 - header.bits * (x % in_byte + 1))) &
                                        ((1U << header.bits) - 1));
  }
  return indices;
}

/// Grey when all colours of the palette are.
cv::Mat with_palette(const cv::Mat& indices, const BmpHeader& header) {
  const bool grey = std::all_of(header.palette.begin(), header.palette.end(),
                                [](const cv::Vec3b& c) { return c[0] == c[1] && c[1] == c[2]; });
  cv::Mat pixels(indices.size(), grey ? CV_8UC1 : CV_8UC3);
  for (int y = 0; y < indices.rows; ++y)
    for (int x = 0; x < indices.cols; ++x) {
      const std::size_t index = indices.at<std::uint8_t>(y, x);
      if (index >= header.palette.size())
        refuse_damaged("a pixel has palette index " + std::to_string(index) + ", the palette " +
                       std::to_string(header.palette.size()) + " colours");
      if (grey)
        pixels.at<std::uint8_t>(y, x) = header.palette[index][0];
      else
        pixels.at<cv::Vec3b>(y, x) = header.palette[index];
    }
  return pixels;
}

cv::Mat true_color(Bytes data, const BmpHeader& header) {
  const auto sample = [](std::uint32_t pixel, std::uint32_t mask) {
    if (mask == 0) return std::uint8_t{0};
    const int shift = std::countr_zero(mask);
    return static_cast<std::uint8_t>(rescaled((pixel & mask) >> shift, mask >> shift, 255));
  };
  const bool opacity = header.masks[3] != 0;
  cv::Mat pixels(header.height, header.width, opacity ? CV_8UC4 : CV_8UC3);
  const std::size_t bytes = header.bits / 8;
  for (int y = 0; y < header.height; ++y) {
    const unsigned char* from = row_of(data, header, y);
    auto* to = pixels.ptr<std::uint8_t>(y);
    for (int x = 0; x < header.width; ++x, from += bytes) {
      std::uint32_t pixel = 0;
      for (std::size_t i = 0; i < bytes; ++i) pixel |= std::uint32_t{from[i]} << (8 * i);
      for (const std::size_t channel : {std::size_t{2}, std::size_t{1}, std::size_t{0}})
        *to++ = sample(pixel, header.masks.at(channel));
      if (opacity) *to++ = sample(pixel, header.masks[3]);
    }
  }
  return opacity ? over_black(pixels) : pixels;
}

}  // namespace

Decoded decode_bmp(Bytes file) {
  BmpHeader header;
  read_size(file, header);
  check_kind(header);
  const std::size_t palette_at = read_masks(file, header);
  read_palette(file, palette_at, header);
  if (header.pixels_at < palette_at) refuse_damaged("its pixels begin inside its header");
  need(file, header.pixels_at, "picture");
  const Bytes data = file.subspan(header.pixels_at);
  const bool runs = header.compression == rle8 || header.compression == rle4;
  const std::uint64_t whole = header.row_bytes() * static_cast<std::uint64_t>(header.height);
  if (!runs && data.size() < whole)
    refuse_truncated(std::to_string(data.size()) + " of " + std::to_string(whole) + " bytes of picture");
  if (header.bits <= 8) return {with_palette(palette_indices(data, header), header), 1};
  return {true_color(data, header), 1};
}

}  // namespace eigenpose::decoders
