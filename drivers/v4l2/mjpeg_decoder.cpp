#include "drivers/v4l2/mjpeg_decoder.h"

#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>

namespace eigenpose {

struct MjpegDecoder::State {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  std::jmp_buf escape{};
};

namespace {

/// libjpeg reports a fatal error by calling this, which must not return.
void leave(j_common_ptr jpeg) {
  auto* escape = static_cast<std::jmp_buf*>(jpeg->client_data);
  std::longjmp(*escape, 1);
}

/// A warning means damaged data. Counted, not printed; the caller asks for the count.
void count_warning(j_common_ptr jpeg, int level) {
  if (level < 0) ++jpeg->err->num_warnings;
}

/// No object with a destructor may live here: an error jumps out.
bool decode_rows(jpeg_decompress_struct& jpeg, std::jmp_buf& escape, const std::uint8_t* data,
                 std::size_t size, std::uint8_t* rows, std::size_t stride, unsigned width, unsigned height,
                 bool color) {
  if (setjmp(escape) != 0) {
    jpeg_abort_decompress(&jpeg);
    return false;
  }
  jpeg_mem_src(&jpeg, data, size);
  jpeg_read_header(&jpeg, TRUE);
  if (jpeg.image_width != width || jpeg.image_height != height) {
    jpeg_abort_decompress(&jpeg);
    return false;
  }
  jpeg.out_color_space = color ? JCS_EXT_BGR : JCS_GRAYSCALE;
  jpeg_start_decompress(&jpeg);
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = rows + jpeg.output_scanline * stride;
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_decompress(&jpeg);
  return jpeg.err->num_warnings == 0;
}

}  // namespace

MjpegDecoder::MjpegDecoder() : state_(std::make_unique<State>()) {
  state_->jpeg.err = jpeg_std_error(&state_->errors);
  state_->errors.error_exit = leave;
  state_->errors.emit_message = count_warning;
  state_->errors.output_message = [](j_common_ptr) {};
  jpeg_create_decompress(&state_->jpeg);
  state_->jpeg.client_data = &state_->escape;
}

MjpegDecoder::~MjpegDecoder() {
  jpeg_destroy_decompress(&state_->jpeg);
}

bool MjpegDecoder::decode(std::span<const std::uint8_t> jpeg, cv::Mat& picture) {
  state_->errors.num_warnings = 0;
  return decode_rows(state_->jpeg, state_->escape, jpeg.data(), jpeg.size(), picture.data, picture.step[0],
                     static_cast<unsigned>(picture.cols), static_cast<unsigned>(picture.rows),
                     picture.channels() == 3);
}

}  // namespace eigenpose
