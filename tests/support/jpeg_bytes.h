#pragma once

/// JPEG images for tests, written by libjpeg, and what is needed to change them byte by byte.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <vector>

#include <jpeglib.h>
#include <opencv2/core.hpp>

#include "tests/support/picture_bytes.h"

namespace eigenpose::test {

struct JpegParts {
  J_COLOR_SPACE colors = JCS_EXT_BGR;  ///< of the rows given
  bool progressive = false;
  bool separate_scans = false;  ///< sequential, each component in a scan of its own
  int restart_blocks = 0;
  bool adobe = true;
  int across = 2;  ///< brightness samples for each of colour, across and down: 2 × 2 is 4:2:0, 2 × 1 4:2:2
  int down = 2;
};

inline ByteList jpeg_of(const cv::Mat& picture, const JpegParts& parts = {}) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = static_cast<JDIMENSION>(picture.cols);
  jpeg.image_height = static_cast<JDIMENSION>(picture.rows);
  jpeg.input_components = picture.channels();
  jpeg.in_color_space = parts.colors;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  if (jpeg.num_components == 3) {
    jpeg.comp_info[0].h_samp_factor = parts.across;
    jpeg.comp_info[0].v_samp_factor = parts.down;
  }
  if (parts.progressive) jpeg_simple_progression(&jpeg);
  std::vector<jpeg_scan_info> scans(static_cast<std::size_t>(jpeg.num_components));
  for (std::size_t c = 0; c < scans.size(); ++c) scans[c] = {1, {static_cast<int>(c)}, 0, 63, 0, 0};
  if (parts.separate_scans) {
    jpeg.scan_info = scans.data();
    jpeg.num_scans = static_cast<int>(scans.size());
  }
  jpeg.restart_interval = static_cast<unsigned>(parts.restart_blocks);
  jpeg.write_Adobe_marker = parts.adobe && parts.colors == JCS_CMYK ? TRUE : FALSE;
  jpeg_start_compress(&jpeg, TRUE);
  for (int y = 0; y < picture.rows; ++y) {
    JSAMPROW row = const_cast<unsigned char*>(picture.ptr(y));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  ByteList result(bytes, bytes + size);
  jpeg_destroy_compress(&jpeg);
  std::free(bytes);
  return result;
}

inline const ByteList end_mark{0xff, 0xd9};

/// Behind the next marker of `kind` from `from` on.
inline std::size_t behind_marker(const ByteList& bytes, unsigned char kind, std::size_t from = 0) {
  const ByteList marker{0xff, kind};
  const auto found = std::search(bytes.begin() + static_cast<std::ptrdiff_t>(from), bytes.end(),
                                 marker.begin(), marker.end());
  if (found == bytes.end()) throw std::invalid_argument("there is no such marker");
  return static_cast<std::size_t>(found - bytes.begin()) + 2;
}

}  // namespace eigenpose::test
