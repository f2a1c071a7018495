/// TIFF 6.0: strips and tiles of grey, RGB, palette and CMYK samples of 1…16 bits, uncompressed or with
/// PackBits, LZW or Deflate; and of grey and YCbCr JPEG (Technical Note 2).

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include <zlib.h>

#include "core/image/decoders/decoders.h"
#include "core/image/decoders/tiff_directory.h"
#include "core/image/jpeg_reader.h"

namespace eigenpose::decoders {
namespace {

enum TiffTag : std::uint16_t {
  tag_width = 256,
  tag_height = 257,
  tag_bits = 258,
  tag_compression = 259,
  tag_photometric = 262,
  tag_fill_order = 266,
  tag_strip_offsets = 273,
  tag_orientation = 274,
  tag_samples = 277,
  tag_rows_per_strip = 278,
  tag_strip_bytes = 279,
  tag_planar = 284,
  tag_predictor = 317,
  tag_color_map = 320,
  tag_tile_width = 322,
  tag_tile_height = 323,
  tag_tile_offsets = 324,
  tag_tile_bytes = 325,
  tag_extra_samples = 338,
  tag_sample_format = 339,
  tag_jpeg_tables = 347
};
enum TiffCompression : std::uint32_t {
  uncompressed = 1,
  lzw = 5,
  jpeg = 7,
  deflate = 8,
  pack_bits = 32773,
  old_deflate = 32946
};
enum TiffColors : std::uint32_t {
  white_is_zero = 0,
  black_is_zero = 1,
  rgb_colors = 2,
  palette = 3,
  cmyk = 5,
  ycbcr = 6
};
enum class TiffOpacity { none, associated, unassociated };

/// What the directory says of the samples.
struct TiffLayout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t bits = 1;     ///< of each sample
  std::uint32_t samples = 1;  ///< of each pixel, extra ones included
  std::uint32_t colors = black_is_zero;
  std::uint32_t compression = uncompressed;
  std::uint32_t predictor = 1;
  bool planar = false;  ///< each sample has planes of its own
  bool reversed_bits = false;
  TiffOpacity opacity = TiffOpacity::none;
  std::uint32_t block_width = 0;  ///< of a tile, or of a strip: the picture's
  std::uint32_t block_height = 0;
  std::vector<std::uint32_t> offsets;
  std::vector<std::uint32_t> bytes;

  /// Samples of a pixel that make its colour.
  [[nodiscard]] std::uint32_t color_samples() const {
    return colors == rgb_colors || colors == ycbcr ? 3 : (colors == cmyk ? 4 : 1);
  }
  [[nodiscard]] std::uint32_t samples_in_block() const { return planar ? 1 : samples; }
  [[nodiscard]] std::size_t block_row_bytes() const {
    return (std::size_t{block_width} * samples_in_block() * bits + 7) / 8;
  }
};

void read_samples(const TiffDirectory& directory, TiffLayout& layout) {
  layout.samples = directory.number(tag_samples, 1);
  const std::vector<std::uint32_t> bits = directory.numbers(tag_bits);
  if (!bits.empty()) layout.bits = bits[0];
  constexpr std::array<std::uint32_t, 5> known{1, 2, 4, 8, 16};
  if (std::find(known.begin(), known.end(), layout.bits) == known.end())
    refuse_unsupported("is a TIFF file of " + std::to_string(layout.bits) + " bits a sample");
  if (std::any_of(bits.begin(), bits.end(), [&](std::uint32_t b) { return b != layout.bits; }))
    refuse_unsupported("is a TIFF file whose samples have different numbers of bits");
  for (const std::uint32_t format : directory.numbers(tag_sample_format))
    if (format != 1 && format != 4) refuse_unsupported("is a TIFF file of signed or floating-point samples");
  layout.colors = directory.number(tag_photometric, black_is_zero);
  if (layout.colors > palette && layout.colors != cmyk && layout.colors != ycbcr)
    refuse_unsupported("is a TIFF file of colour space " + std::to_string(layout.colors));
  constexpr std::uint32_t most_samples = 64;
  if (layout.samples < layout.color_samples() || layout.samples > most_samples)
    refuse_damaged("it has " + std::to_string(layout.samples) + " samples a pixel");
  const std::uint32_t extra = directory.number(tag_extra_samples, 0);
  if (layout.samples > layout.color_samples() && extra == 1) layout.opacity = TiffOpacity::associated;
  if (layout.samples > layout.color_samples() && extra == 2) layout.opacity = TiffOpacity::unassociated;
}

void read_compression(const TiffDirectory& directory, TiffLayout& layout) {
  layout.compression = directory.number(tag_compression, uncompressed);
  constexpr std::array<std::uint32_t, 6> known{uncompressed, lzw, jpeg, deflate, pack_bits, old_deflate};
  if (std::find(known.begin(), known.end(), layout.compression) == known.end())
    refuse_unsupported("is a TIFF file of compression " + std::to_string(layout.compression));
  layout.predictor = directory.number(tag_predictor, 1);
  const bool differences = layout.predictor == 2 && layout.bits >= 8;
  if (layout.predictor != 1 && !differences)
    refuse_unsupported("is a TIFF file of predictor " + std::to_string(layout.predictor));
  layout.reversed_bits = directory.number(tag_fill_order, 1) == 2;
  const bool colors_fit = layout.compression == jpeg
                              ? layout.colors == black_is_zero || layout.colors == ycbcr
                              : layout.colors != ycbcr;
  if (!colors_fit)
    refuse_unsupported("is a TIFF file of compression " + std::to_string(layout.compression) +
                       " and colour space " + std::to_string(layout.colors));
  layout.planar = directory.number(tag_planar, 1) == 2 && layout.samples > 1;
}

void read_blocks(const TiffDirectory& directory, TiffLayout& layout) {
  const bool tiles = directory.has(tag_tile_offsets);
  layout.block_width = tiles ? directory.number(tag_tile_width, 0) : layout.width;
  layout.block_height = tiles ? directory.number(tag_tile_height, 0)
                              : std::min(layout.height, directory.number(tag_rows_per_strip, layout.height));
  check_size(std::int64_t{layout.block_width} * ((layout.samples + 3) / 4), layout.block_height);
  layout.offsets = directory.numbers(tiles ? tag_tile_offsets : tag_strip_offsets);
  layout.bytes = directory.numbers(tiles ? tag_tile_bytes : tag_strip_bytes);
  const auto blocks = [](std::uint32_t whole, std::uint32_t one) {
    return (std::size_t{whole} + one - 1) / one;
  };
  const std::size_t needed = blocks(layout.width, layout.block_width) *
                             blocks(layout.height, layout.block_height) *
                             (layout.planar ? layout.samples : 1);
  if (layout.offsets.size() < needed)
    refuse_truncated("it names " + std::to_string(layout.offsets.size()) + " of " + std::to_string(needed) +
                     " strips or tiles");
  if (layout.bytes.empty() && layout.compression == uncompressed)  // old writers left them out
    layout.bytes.assign(needed, static_cast<std::uint32_t>(layout.block_row_bytes() * layout.block_height));
  if (layout.bytes.size() < needed) refuse_damaged("the lengths of its strips or tiles are missing");
}

TiffLayout read_layout(const TiffDirectory& directory) {
  TiffLayout layout;
  layout.width = directory.number(tag_width, 0);
  layout.height = directory.number(tag_height, 0);
  check_size(layout.width, layout.height);
  read_samples(directory, layout);
  // The samples of all pixels, too, are within the budget of a colour picture with opacity.
  check_size(std::int64_t{layout.width} * ((layout.samples + 3) / 4), layout.height);
  read_compression(directory, layout);
  read_blocks(directory, layout);
  return layout;
}

/// PackBits: a byte n ≥ 0 is followed by n + 1 literal bytes, n < 0 by one byte to be repeated 1 − n times.
void unpack_bits(Bytes from, std::vector<unsigned char>& to, std::size_t whole) {
  for (std::size_t at = 0; at < from.size() && to.size() < whole;) {
    const int n = static_cast<signed char>(from[at++]);
    if (n == -128) continue;
    const std::size_t count = n >= 0 ? static_cast<std::size_t>(n) + 1 : static_cast<std::size_t>(1 - n);
    if (n >= 0) {
      const std::size_t there = std::min(count, from.size() - at);
      to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(at),
                from.begin() + static_cast<std::ptrdiff_t>(at + there));
      at += there;
    } else if (at < from.size()) {
      to.insert(to.end(), count, from[at++]);
    }
  }
}

/// TIFF's LZW: codes of 9…12 bits, most significant bit first, a code longer one code early.
class LzwReader {
 public:
  explicit LzwReader(Bytes from) : from_(from) {}

  void read(std::vector<unsigned char>& to, std::size_t whole) {
    constexpr std::uint32_t clear = 256;
    constexpr std::uint32_t end = 257;
    std::optional<std::uint32_t> before;
    while (to.size() < whole) {
      const std::optional<std::uint32_t> code = next();
      if (!code || *code == end) return;
      if (*code == clear) {
        used_ = first_free;
        width_ = 9;
        before.reset();
        continue;
      }
      if (*code > used_ || (*code == used_ && !before) || (!before && *code >= clear))
        refuse_damaged("one of its LZW codes is not defined");
      write(*code, before, to);
      before = *code;
    }
  }

 private:
  static constexpr std::uint32_t first_free = 258;
  static constexpr std::uint32_t most = 4096;
  struct Word {
    std::size_t at = 0;  ///< in the output
    std::size_t length = 0;
  };

  std::optional<std::uint32_t> next() {
    while (bits_ < width_) {
      if (at_ >= from_.size()) return std::nullopt;
      buffer_ = buffer_ << 8U | from_[at_++];
      bits_ += 8;
    }
    bits_ -= width_;
    return static_cast<std::uint32_t>(buffer_ >> bits_) & ((1U << width_) - 1);
  }

  /// Writes the word of `code` and defines the next one: the word before and the first byte of this one,
  /// which lie side by side in the output.
  void write(std::uint32_t code, std::optional<std::uint32_t> before, std::vector<unsigned char>& to) {
    const std::size_t start = to.size();
    if (before && used_ < most) {
      words_.at(used_) = {start - last_length_, last_length_ + 1};
      ++used_;
    }
    if (code < 256) {
      to.push_back(static_cast<unsigned char>(code));
    } else {
      const Word word = words_.at(code);
      for (std::size_t i = 0; i < word.length; ++i) to.push_back(to[word.at + i]);
    }
    last_length_ = to.size() - start;
    if (used_ + 1 >= (1U << width_) && width_ < 12) ++width_;
  }

  Bytes from_;
  std::size_t at_ = 0;
  std::uint64_t buffer_ = 0;
  std::uint32_t bits_ = 0;
  std::uint32_t width_ = 9;
  std::uint32_t used_ = first_free;
  std::size_t last_length_ = 0;
  std::array<Word, most> words_{};
};

void inflate_block(Bytes from, std::vector<unsigned char>& to, std::size_t whole) {
  to.resize(whole);
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
  stream.next_in = const_cast<unsigned char*>(from.data());  // zlib only reads
  stream.avail_in = static_cast<uInt>(from.size());
  stream.next_out = to.data();
  stream.avail_out = static_cast<uInt>(whole);
  const int result = inflate(&stream, Z_FINISH);
  const std::size_t made = whole - stream.avail_out;
  inflateEnd(&stream);
  if (result != Z_STREAM_END && result != Z_BUF_ERROR && result != Z_OK)
    refuse_damaged("its Deflate data cannot be decompressed");
  to.resize(made);
}

/// The bytes of one strip or tile as they lie in the file, at most as many as there are.
Bytes raw_block(Bytes file, const TiffLayout& layout, std::size_t index) {
  const std::size_t at = layout.offsets[index];
  if (at > file.size()) refuse_truncated("strip or tile " + std::to_string(index) + " lies behind its end");
  return file.subspan(at, std::min<std::size_t>(layout.bytes[index], file.size() - at));
}

/// The bytes of one strip or tile, decompressed: `whole` of them.
std::vector<unsigned char> read_block(Bytes file, const TiffLayout& layout, std::size_t index,
                                      std::size_t whole) {
  const Bytes there = raw_block(file, layout, index);
  std::vector<unsigned char> raw(there.begin(), there.end());
  if (layout.reversed_bits)
    for (unsigned char& byte : raw)
      byte = static_cast<unsigned char>((byte * 0x0202020202ULL & 0x010884422010ULL) % 1023);
  std::vector<unsigned char> bytes;
  switch (layout.compression) {
    case lzw:
      if (raw.size() >= 2 && raw[0] == 0 && (raw[1] & 1U) != 0)
        refuse_unsupported("is a TIFF file of the LZW compression before TIFF 6.0");
      LzwReader(raw).read(bytes, whole);
      break;
    case deflate:
    case old_deflate:
      inflate_block(raw, bytes, whole);
      break;
    case pack_bits:
      unpack_bits(raw, bytes, whole);
      break;
    default:
      bytes = std::move(raw);
      break;
  }
  if (bytes.size() < whole)
    refuse_truncated("strip or tile " + std::to_string(index) + " has " + std::to_string(bytes.size()) +
                     " of " + std::to_string(whole) + " bytes");
  return bytes;
}

/// One row of a block as samples; the differences of the predictor added up.
void unpack_row(const TiffDirectory& directory, const TiffLayout& layout, const unsigned char* from,
                std::span<std::uint16_t> samples) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (layout.bits == 16) {
      samples[i] = static_cast<std::uint16_t>(directory.read_16(from + 2 * i));
    } else {
      const std::size_t bit = i * layout.bits;
      samples[i] = static_cast<std::uint16_t>((from[bit / 8] >> (8 - layout.bits - bit % 8)) &
                                              ((1U << layout.bits) - 1));
    }
  }
  if (layout.predictor != 2) return;
  const std::uint32_t mask = (1U << layout.bits) - 1;
  for (std::size_t i = layout.samples_in_block(); i < samples.size(); ++i)
    samples[i] = static_cast<std::uint16_t>((samples[i] + samples[i - layout.samples_in_block()]) & mask);
}

/// Every sample of the picture as it is in the file: CV_16U, as many channels as a colour and its opacity
/// have.
cv::Mat read_samples_of_all(Bytes file, const TiffDirectory& directory, const TiffLayout& layout) {
  const std::uint32_t kept = layout.color_samples() + (layout.opacity == TiffOpacity::none ? 0 : 1);
  cv::Mat all(static_cast<int>(layout.height), static_cast<int>(layout.width),
              CV_16UC(static_cast<int>(kept)));
  const std::uint32_t in_block = layout.samples_in_block();
  std::vector<std::uint16_t> row(std::size_t{layout.block_width} * in_block);
  std::size_t index = 0;
  for (std::uint32_t plane = 0; plane < (layout.planar ? layout.samples : 1); ++plane)
    for (std::uint32_t top = 0; top < layout.height; top += layout.block_height)
      for (std::uint32_t left = 0; left < layout.width; left += layout.block_width, ++index) {
        if (plane >= kept) continue;
        const std::uint32_t rows = std::min(layout.block_height, layout.height - top);
        const std::uint32_t columns = std::min(layout.block_width, layout.width - left);
        const auto bytes = read_block(file, layout, index, layout.block_row_bytes() * rows);
        for (std::uint32_t y = 0; y < rows; ++y) {
          unpack_row(directory, layout, bytes.data() + y * layout.block_row_bytes(), row);
          std::uint16_t* to = all.ptr<std::uint16_t>(static_cast<int>(top + y)) + std::size_t{left} * kept;
          for (std::uint32_t x = 0; x < columns; ++x)
            for (std::uint32_t s = 0; s < std::min(in_block, kept); ++s)
              to[x * kept + plane + s] = row[std::size_t{x} * in_block + s];
        }
      }
  return all;
}

/// Samples to the full range of `depth`, in the order of OpenCV; white-is-zero turned round.
cv::Mat scaled(const cv::Mat& all, const TiffLayout& layout, int depth) {
  const std::uint32_t largest = (1U << layout.bits) - 1;
  const std::uint32_t full = depth == CV_16U ? 65535 : 255;
  const int channels = all.channels();
  cv::Mat result(all.size(), CV_MAKETYPE(depth, channels));
  for (int y = 0; y < all.rows; ++y)
    for (int i = 0; i < all.cols * channels; ++i) {
      const int channel = i % channels;
      std::uint32_t value = all.ptr<std::uint16_t>(y)[i];
      if (layout.colors == white_is_zero && channel == 0) value = largest - value;
      const int to = layout.colors == rgb_colors && channel < 3 ? i - channel + 2 - channel : i;
      if (depth == CV_16U)
        result.ptr<std::uint16_t>(y)[to] = static_cast<std::uint16_t>(rescaled(value, largest, full));
      else
        result.ptr<std::uint8_t>(y)[to] = static_cast<std::uint8_t>(rescaled(value, largest, full));
    }
  return result;
}

/// BGR, and the opacity if there is one.
cv::Mat with_color_map(const cv::Mat& all, const TiffDirectory& directory, const TiffLayout& layout) {
  const std::vector<std::uint32_t> map = directory.numbers(tag_color_map);
  const std::size_t colors = std::size_t{1} << layout.bits;
  if (map.size() < 3 * colors) refuse_damaged("its colour map is missing or cut off");
  const bool of_8_bits = std::all_of(map.begin(), map.end(), [](std::uint32_t v) { return v < 256; });
  const int channels = all.channels();
  cv::Mat result(all.size(), CV_MAKETYPE(CV_8U, channels + 2));
  for (int y = 0; y < all.rows; ++y)
    for (int x = 0; x < all.cols; ++x) {
      const std::uint16_t* from = all.ptr<std::uint16_t>(y) + x * channels;
      auto* to = result.ptr<std::uint8_t>(y) + x * (channels + 2);
      for (std::size_t c = 0; c < 3; ++c)
        to[2 - c] = static_cast<std::uint8_t>(of_8_bits ? map[c * colors + from[0]]
                                                        : map[c * colors + from[0]] >> 8U);
      if (channels == 2) to[3] = static_cast<std::uint8_t>(rescaled(from[1], (1U << layout.bits) - 1, 255));
    }
  return result;
}

/// Inks C, M, Y, K, 0…255 each, to BGR; a fifth channel (opacity) stays.
cv::Mat without_ink(const cv::Mat& inks) {
  const int channels = inks.channels();
  cv::Mat result(inks.size(), CV_MAKETYPE(CV_8U, channels - 1));
  for (int y = 0; y < inks.rows; ++y)
    for (int x = 0; x < inks.cols; ++x) {
      const std::uint8_t* ink = inks.ptr<std::uint8_t>(y) + x * channels;
      auto* to = result.ptr<std::uint8_t>(y) + x * (channels - 1);
      for (int c = 0; c < 3; ++c)
        to[2 - c] = static_cast<std::uint8_t>(rescaled(255U - ink[c], 255, 255U - ink[3]));
      if (channels == 5) to[3] = ink[4];
    }
  return result;
}

/// One strip or tile of JPEG; the tables that all share go in front of its data.
cv::Mat jpeg_block(Bytes data, Bytes tables, bool grey) {
  std::vector<unsigned char> stream;
  constexpr std::size_t mark = 2;  // both begin with a start mark, and the tables end with an end mark
  if (tables.size() > 2 * mark && data.size() > mark) {
    stream.assign(tables.begin(), tables.end() - mark);
    data = data.subspan(mark);
  }
  stream.insert(stream.end(), data.begin(), data.end());
  JpegReader reader;
  refuse_jpeg(reader.open(stream));
  const JpegReader::Header& header = reader.header();
  check_size(header.width, header.height);
  if (header.components != (grey ? 1 : 3)) refuse_damaged("its JPEG data has other colours than it says");
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width), grey ? CV_8UC1 : CV_8UC3);
  refuse_jpeg(reader.decode(pixels));
  return pixels;
}

cv::Mat read_jpeg_blocks(Bytes file, const TiffDirectory& directory, const TiffLayout& layout) {
  const bool grey = layout.colors == black_is_zero;
  if (layout.bits != 8 || layout.planar || layout.samples != layout.color_samples())
    refuse_unsupported("is a TIFF file of JPEG data that is not 8-bit grey or YCbCr");
  cv::Mat pixels(static_cast<int>(layout.height), static_cast<int>(layout.width), grey ? CV_8UC1 : CV_8UC3);
  const Bytes tables = directory.raw(tag_jpeg_tables);
  const int across = static_cast<int>(layout.block_width);
  const int down = static_cast<int>(layout.block_height);
  std::size_t index = 0;
  for (int top = 0; top < pixels.rows; top += down)
    for (int left = 0; left < pixels.cols; left += across, ++index) {
      const cv::Mat block = jpeg_block(raw_block(file, layout, index), tables, grey);
      const cv::Rect place = cv::Rect(left, top, across, down) & cv::Rect({}, pixels.size());
      if (block.cols < place.width || block.rows < place.height)
        refuse_damaged("strip or tile " + std::to_string(index) + " is smaller than it says");
      block(cv::Rect({}, place.size())).copyTo(pixels(place));
    }
  return pixels;
}

/// BGR or grey from samples as they are in the file.
cv::Mat pixels_of(const cv::Mat& all, const TiffDirectory& directory, const TiffLayout& layout) {
  const bool grey = layout.colors == white_is_zero || layout.colors == black_is_zero;
  cv::Mat pixels;
  if (layout.colors == palette)
    pixels = with_color_map(all, directory, layout);
  else
    pixels = scaled(all, layout, layout.bits == 16 && layout.colors != cmyk ? CV_16U : CV_8U);
  if (layout.colors == cmyk) pixels = without_ink(pixels);
  if (layout.opacity == TiffOpacity::unassociated) pixels = over_black(pixels);
  if (layout.opacity == TiffOpacity::associated) {  // multiplied already: the opacity has done its work
    std::vector<cv::Mat> channels;
    cv::split(pixels, channels);
    channels.pop_back();
    cv::merge(channels, pixels);
  }
  return !grey && pixels.depth() == CV_16U ? to_8_bits(pixels) : pixels;
}

}  // namespace

Decoded decode_tiff(Bytes file) {
  const TiffDirectory directory(file);
  const TiffLayout layout = read_layout(directory);
  const cv::Mat pixels = layout.compression == jpeg
                             ? read_jpeg_blocks(file, directory, layout)
                             : pixels_of(read_samples_of_all(file, directory, layout), directory, layout);
  const std::uint32_t orientation = directory.number(tag_orientation, 1);
  return {pixels, orientation >= 1 && orientation <= 8 ? static_cast<int>(orientation) : 1};
}

}  // namespace eigenpose::decoders
