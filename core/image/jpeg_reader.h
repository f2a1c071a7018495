#pragma once

/// JPEG to pixels with libjpeg-turbo itself, which reports what OpenCV keeps to itself: whether every pixel
/// was in the data.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <opencv2/core.hpp>

namespace eigenpose {

/// Why the pixels of a JPEG image cannot be trusted, or nothing.
enum class JpegFault {
  none,
  no_image,       ///< empty, or no JPEG header: nothing to decode
  unsupported,    ///< 12 bits, lossless, or colours that cannot be converted
  damaged_data,   ///< codes that do not exist, or a restart marker out of its order
  cut_short,      ///< the data ends, or a marker comes, before the last pixel
  missing_scans,  ///< of a progressive or multi-scan image: pixels are there, but coarse or without colour
  stray_bytes,    ///< more bytes before a marker than any padding has: the decoder has lost its place
  missing_end,    ///< every pixel is there, the end marker is not
};

/// Reads one image after another, keeping libjpeg's working memory. Lives on one thread.
///
/// `open`, then `decode`. Not faults, because no pixel depends on them: missing Huffman tables (the standard
/// ones are taken, as MJPEG cameras want it), about 16 stray bytes before a marker, bytes after the end
/// marker, unknown versions and parameters that a sequential image does not use.
class JpegReader {
 public:
  enum class Keep { pixels_only, exif };
  explicit JpegReader(Keep keep = Keep::pixels_only);
  ~JpegReader();
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  struct Header {
    std::uint32_t width = 0;   ///< pixels
    std::uint32_t height = 0;  ///< pixels
    int components = 0;        ///< 1: grey, 3: colour, 4: CMYK
  };
  /// Reads up to the first scan. @param bytes must stay until `decode` has returned.
  JpegFault open(std::span<const std::uint8_t> bytes);
  /// Of the image opened last.
  [[nodiscard]] const Header& header() const;
  /// The data of the first APP1 segment "Exif", its name left out; empty if there is none or it is not kept.
  [[nodiscard]] std::span<const std::uint8_t> exif() const;

  /// Decodes the image that was opened. @param picture of its size: CV_8UC3 (BGR) or CV_8UC1 (brightness
  /// only, much cheaper). @return the first fault in the order of the enumeration; after `none` and
  /// `missing_end` every pixel is right, after others `picture` is undefined.
  /// @pre the last call of `open` returned `none`.
  JpegFault decode(cv::Mat& picture);
  /// Bytes of the image decoded last, its end marker included.
  [[nodiscard]] std::size_t bytes_read() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eigenpose
