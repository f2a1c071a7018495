#pragma once

/// The decoders of the picture formats, one file each. Only `picture_file.cpp` calls them.
///
/// Each takes the bytes of a whole file that begins with its format's signature, and returns every pixel or
/// throws. The rules they share:
///  - the size is checked against `most_pixels` before anything of that size is allocated or decoded;
///  - samples are scaled from the range of the format (2^bits − 1, or the maxval) to 255 or 65535; gamma and
///    colour profiles are ignored;
///  - grey of more than 8 bits stays 16-bit, colour becomes 8-bit;
///  - what is transparent is black: a sample is multiplied by its opacity;
///  - bytes behind the end of the picture are ignored, bytes missing before it are an error.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

#include <opencv2/core.hpp>

#include "core/image/jpeg_reader.h"

namespace eigenpose::decoders {

using Bytes = std::span<const unsigned char>;

/// Pixels of the largest picture that is decoded: of 134 million, 400 MB in colour. The largest cameras have
/// about 100 million.
constexpr std::uint64_t most_pixels = std::uint64_t{1} << 27U;

/// What is wrong with a picture. The text goes on after the name of the file: "is damaged: …".
class PictureError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// @throws PictureError "is damaged: …; copy or take the picture again".
[[noreturn]] void refuse_damaged(const std::string& what);
/// @throws PictureError "is truncated: …; copy or take the picture again".
[[noreturn]] void refuse_truncated(const std::string& what);
/// @throws PictureError "`what`; save it as …".
[[noreturn]] void refuse_unsupported(const std::string& what);
/// @throws PictureError for every fault but `none`.
void refuse_jpeg(JpegFault fault);
/// @throws PictureError unless both sides are positive and the picture is within `most_pixels`.
void check_size(std::int64_t width, std::int64_t height);

/// Pixels as they lie in the file, and how the camera was held.
struct Decoded {
  cv::Mat pixels;       ///< CV_8UC1, CV_8UC3 (BGR) or CV_16UC1
  int orientation = 1;  ///< of EXIF and TIFF: 1…8, the corner that the first pixel shows; 1 is upright
};

Decoded decode_png(Bytes file);   ///< PNG (third edition; the still image of an animation)
Decoded decode_jpeg(Bytes file);  ///< baseline, extended and progressive JPEG: grey, YCbCr, RGB, CMYK
Decoded decode_pnm(Bytes file);   ///< PBM, PGM and PPM, plain and raw (P1…P6); the first picture of several
Decoded decode_bmp(Bytes file);   ///< Windows and OS/2 bitmaps of 1…32 bits, RLE4, RLE8, bit fields
Decoded decode_tiff(Bytes file);  ///< the first picture: baseline TIFF 6.0, LZW, Deflate, JPEG, tiles, alpha

/// The orientation in EXIF data (which is a TIFF directory); 1 when there is none or it cannot be read.
int exif_orientation(Bytes exif);

/// Turns and mirrors `pixels` so that what the orientation says is upright.
cv::Mat upright(const cv::Mat& pixels, int orientation);

/// The colour or grey channels of `image` times its last channel, the opacity.
/// @param image 8 or 16 bits, 2 or 4 channels. @return 1 or 3 channels of the same depth.
cv::Mat over_black(const cv::Mat& image);

/// 16-bit samples to the nearest 8-bit ones, v / 257.
cv::Mat to_8_bits(const cv::Mat& image);

/// `value` of 0…`largest` on the scale 0…`full`, to the nearest.
constexpr std::uint32_t rescaled(std::uint32_t value, std::uint32_t largest, std::uint32_t full) {
  return static_cast<std::uint32_t>((std::uint64_t{value} * full + largest / 2) / largest);
}

}  // namespace eigenpose::decoders
