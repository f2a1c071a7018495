/// PNG: https://www.w3.org/TR/png-3/.

#include <bit>
#include <csetjmp>
#include <cstring>
#include <vector>

#include <png.h>
#include <zlib.h>

#include "core/image/decoders/decoders.h"

namespace eigenpose::decoders {
namespace {

constexpr std::size_t signature_bytes = 8;

std::uint32_t big_32(Bytes bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24U | std::uint32_t{bytes[at + 1]} << 16U |
         std::uint32_t{bytes[at + 2]} << 8U | bytes[at + 3];
}

/// Checks every chunk (length, type, data, CRC of type and data) up to the end mark, those too that the
/// decoder would pass over. @return the data of eXIf, or nothing.
Bytes check_chunks(Bytes file) {
  constexpr std::size_t frame = 12;  // bytes of a chunk beside its data
  Bytes exif;
  std::size_t at = signature_bytes;
  while (file.size() - at >= frame) {
    const std::size_t length = big_32(file, at);
    if (length > file.size() - at - frame) break;
    const auto crc = crc32(0L, file.data() + at + 4, static_cast<uInt>(length + 4));
    if (crc != big_32(file, at + 8 + length)) refuse_damaged("wrong checksum at byte " + std::to_string(at));
    const unsigned char* type = file.data() + at + 4;
    if (std::memcmp(type, "eXIf", 4) == 0) exif = file.subspan(at + 8, length);
    if (std::memcmp(type, "IEND", 4) == 0) return exif;
    at += length + frame;
  }
  refuse_truncated("a PNG file without its end (" + std::to_string(file.size()) + " bytes)");
}

/// libpng reading from memory. Its errors jump to `escape`, its warnings (about remarks, never pixels) are
/// dropped.
struct PngReader {
  Bytes file;
  std::size_t at = 0;
  std::jmp_buf escape{};
  png_structp png = nullptr;
  png_infop info = nullptr;
  png_uint_32 width = 0;
  png_uint_32 height = 0;
  int bits = 0;
  int channels = 0;

  explicit PngReader(Bytes bytes) : file(bytes) {
    png = png_create_read_struct(
        PNG_LIBPNG_VER_STRING, this,
        [](png_structp from, png_const_charp) {
          std::longjmp(static_cast<PngReader*>(png_get_error_ptr(from))->escape, 1);
        },
        [](png_structp, png_const_charp) {});
    if (png != nullptr) info = png_create_info_struct(png);
    if (info == nullptr) throw std::bad_alloc();
    png_set_read_fn(png, this, [](png_structp from, png_bytep to, std::size_t count) {
      auto* reader = static_cast<PngReader*>(png_get_io_ptr(from));
      if (count > reader->file.size() - reader->at) png_error(from, "end of file");
      std::memcpy(to, reader->file.data() + reader->at, count);
      reader->at += count;
    });
  }
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  // No object with a destructor may live in the two functions below: an error jumps out of them.

  bool read_header() {
    if (setjmp(escape) != 0) return false;
    png_read_info(png, info);
    width = png_get_image_width(png, info);
    height = png_get_image_height(png, info);
    return true;
  }

  /// Samples of 8 bits, or of 16 where the file has them; a colour key to opacity. Palette indices stay.
  bool set_up() {
    if (setjmp(escape) != 0) return false;
    if (png_get_color_type(png, info) == PNG_COLOR_TYPE_PALETTE)
      png_set_packing(png);
    else
      png_set_expand(png);
    if (png_get_bit_depth(png, info) == 16 && std::endian::native == std::endian::little) png_set_swap(png);
    png_set_bgr(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    bits = png_get_bit_depth(png, info);
    channels = png_get_channels(png, info);
    return true;
  }

  bool read_rows(png_bytepp rows) {
    if (setjmp(escape) != 0) return false;
    png_read_image(png, rows);
    png_read_end(png, nullptr);
    return true;
  }

  /// BGR, and the opacity if a colour has one.
  [[nodiscard]] cv::Mat with_palette(const cv::Mat& indices) const {
    png_colorp colors = nullptr;
    png_bytep opacity = nullptr;
    int count = 0;
    int opacities = 0;
    png_get_PLTE(png, info, &colors, &count);
    png_get_tRNS(png, info, &opacity, &opacities, nullptr);
    const bool transparent = opacity != nullptr;
    cv::Mat pixels(indices.size(), transparent ? CV_8UC4 : CV_8UC3);
    for (int y = 0; y < indices.rows; ++y) {
      auto* to = pixels.ptr<std::uint8_t>(y);
      for (int x = 0; x < indices.cols; ++x) {
        const int index = indices.at<std::uint8_t>(y, x);
        if (index >= count) refuse_damaged("a pixel has a palette index without a colour");
        *to++ = colors[index].blue;
        *to++ = colors[index].green;
        *to++ = colors[index].red;
        if (transparent) *to++ = index < opacities ? opacity[index] : 255;
      }
    }
    return pixels;
  }
};

}  // namespace

Decoded decode_png(Bytes file) {
  const Bytes exif = check_chunks(file);
  // The size stands in the first chunk: known before the decoder sees it.
  if (file.size() < 33 || std::memcmp(file.data() + 12, "IHDR", 4) != 0)
    refuse_damaged("it has no PNG header");
  check_size(big_32(file, 16), big_32(file, 20));
  PngReader reader(file);
  if (!reader.read_header() || !reader.set_up()) refuse_damaged("its PNG header makes no sense");
  cv::Mat pixels(static_cast<int>(reader.height), static_cast<int>(reader.width),
                 CV_MAKETYPE(reader.bits == 16 ? CV_16U : CV_8U, reader.channels));
  std::vector<png_bytep> rows(reader.height);
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = pixels.ptr(static_cast<int>(y));
  if (!reader.read_rows(rows.data())) refuse_damaged("its PNG data cannot be decoded to the last pixel");
  if (png_get_color_type(reader.png, reader.info) == PNG_COLOR_TYPE_PALETTE)
    pixels = reader.with_palette(pixels);
  if (pixels.channels() % 2 == 0) pixels = over_black(pixels);
  if (pixels.type() == CV_16UC3) pixels = to_8_bits(pixels);
  return {pixels, exif_orientation(exif)};
}

}  // namespace eigenpose::decoders
