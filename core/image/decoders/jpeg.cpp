/// JPEG files (ITU-T T.81), JFIF, Exif or neither.

#include "core/image/decoders/decoders.h"
#include "core/image/jpeg_reader.h"

namespace eigenpose::decoders {

void refuse_jpeg(JpegFault fault) {
  switch (fault) {
    case JpegFault::none:
      return;
    case JpegFault::no_image:
      refuse_truncated("a JPEG file without a picture");
    case JpegFault::unsupported:
      refuse_unsupported("is a JPEG file of a kind that is not read (12 bits or lossless)");
    case JpegFault::cut_short:
      refuse_truncated("a JPEG file whose last pixels are missing");
    case JpegFault::missing_scans:
      refuse_truncated("a JPEG file whose last scans are missing");
    case JpegFault::missing_end:
      refuse_truncated("a JPEG file without its end");
    case JpegFault::damaged_data:
    case JpegFault::stray_bytes:
      refuse_damaged("its JPEG data cannot be decoded without errors");
  }
}

Decoded decode_jpeg(Bytes file) {
  JpegReader reader(JpegReader::Keep::exif);
  refuse_jpeg(reader.open(file));
  const JpegReader::Header& header = reader.header();
  check_size(header.width, header.height);
  const int orientation = exif_orientation(reader.exif());
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width),
                 header.components == 1 ? CV_8UC1 : CV_8UC3);
  refuse_jpeg(reader.decode(pixels));
  return {pixels, orientation};
}

}  // namespace eigenpose::decoders
