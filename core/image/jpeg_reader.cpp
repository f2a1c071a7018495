#include "core/image/jpeg_reader.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include <jpeglib.h>
// jpeglib.h comes first: jerror.h needs it.
#include <jerror.h>

namespace eigenpose {
namespace {

/// Cameras pad the data before a marker to words of up to 16 bytes; a USB packet that comes twice is far
/// longer.
constexpr std::int64_t most_stray_bytes = 16;
/// Bytes before a restart marker that libjpeg had already read into its 64-bit buffer are not reported at
/// once but added to the next report.
constexpr std::int64_t most_unreported_bytes = 8;
/// A scan costs a pass over all coefficients. Encoders make about ten, libjpeg's tools refuse at this number.
constexpr int most_scans = 500;
constexpr std::array<unsigned char, 6> exif_name{'E', 'x', 'i', 'f', 0, 0};

}  // namespace

struct JpegReader::State {
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  std::jmp_buf escape{};
  bool damaged = false;
  bool cut_short = false;
  bool missing_end = false;
  bool stray_bytes = false;
  std::int64_t stray_row = 0;  ///< of blocks, of the last report
  std::span<const std::uint8_t> bytes;
  std::size_t bytes_read = 0;
  Header header;
  std::vector<std::uint8_t> inks;  ///< a row of CMYK

  static State& of(j_common_ptr jpeg) { return *static_cast<State*>(jpeg->client_data); }
  void forget_faults() {
    damaged = cut_short = missing_end = stray_bytes = false;
    stray_row = 0;
  }

  [[nodiscard]] JpegFault fault() const {
    if (damaged) return JpegFault::damaged_data;
    if (cut_short) return JpegFault::cut_short;
    if (stray_bytes) return JpegFault::stray_bytes;
    return missing_end ? JpegFault::missing_end : JpegFault::none;
  }

  /// What stopped libjpeg.
  [[nodiscard]] JpegFault fatal() const {
    switch (errors.msg_code) {
      case JERR_BAD_PRECISION:
      case JERR_SOF_UNSUPPORTED:
      case JERR_CONVERSION_NOTIMPL:
        return JpegFault::unsupported;
      case JERR_NO_SOI:
      case JERR_INPUT_EMPTY:
      case JERR_EMPTY_IMAGE:
        return JpegFault::no_image;
      default:
        return cut_short || missing_end ? JpegFault::cut_short : JpegFault::damaged_data;
    }
  }

  /// A warning by what it means for the pixels.
  void note(int code, int number) {
    switch (code) {
      case JWRN_HIT_MARKER:
        cut_short = true;
        break;
      case JWRN_JPEG_EOF:
        missing_end = true;
        break;
      case JWRN_EXTRANEOUS_DATA:
        note_stray_bytes(number);
        break;
      case JWRN_ARITH_BAD_CODE:
      case JWRN_BOGUS_PROGRESSION:
      case JWRN_HUFF_BAD_CODE:
      case JWRN_MUST_RESYNC:
        damaged = true;
        break;
      default:
        break;
    }
  }

  /// `number` bytes before the next marker, those before the restart markers since the last report included.
  void note_stray_bytes(std::int64_t number) {
    const auto restarts_before = [this](std::int64_t row) {  // of blocks
      return jpeg.restart_interval == 0 ? 0 : row * jpeg.MCUs_per_row / jpeg.restart_interval;
    };
    const std::int64_t row = jpeg.input_iMCU_row;
    if (row < stray_row) stray_row = 0;  // another scan
    const std::int64_t restarts = restarts_before(row + 1) - restarts_before(stray_row);
    stray_bytes = stray_bytes || number > most_stray_bytes + most_unreported_bytes * restarts;
    stray_row = row;
  }

  /// Pixels that came, but not all of what makes them. Before the image is finished.
  [[nodiscard]] bool scans_missing() const {
    for (int c = 0; c < jpeg.num_components; ++c) {
      if (jpeg.comp_info[c].quant_table == nullptr) return true;  // it was in no scan
      if (jpeg.coef_bits == nullptr) continue;
      const int* bits = jpeg.coef_bits[c];  // for each coefficient the bits still to come, −1: all
      if (std::any_of(bits, bits + DCTSIZE2, [](int b) { return b != 0; })) return true;
    }
    return false;
  }
};

namespace {

/// Inks as Adobe writes them, 255 for none, to BGR; `plain` inks are the other way round.
void convert_inks(const std::uint8_t* inks, std::uint8_t* bgr, std::uint32_t width, bool plain) {
  for (std::uint32_t x = 0; x < width; ++x, inks += 4, bgr += 3) {
    const auto left = [&](int i) { return static_cast<unsigned>(plain ? 255 - inks[i] : inks[i]); };
    for (int c = 0; c < 3; ++c) bgr[2 - c] = static_cast<std::uint8_t>((left(c) * left(3) + 127) / 255);
  }
}

}  // namespace

// A fatal error is reported by `error_exit`, which must not return: it jumps to `escape`. So no object with a
// destructor may live between setjmp and the end of a function here.

JpegReader::JpegReader(Keep keep) : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.jpeg.err = jpeg_std_error(&state.errors);
  state.errors.error_exit = [](j_common_ptr jpeg) { std::longjmp(State::of(jpeg).escape, 1); };
  state.errors.emit_message = [](j_common_ptr jpeg, int level) {
    if (level < 0) State::of(jpeg).note(jpeg->err->msg_code, jpeg->err->msg_parm.i[0]);
  };
  state.errors.output_message = [](j_common_ptr) {};
  state.jpeg.client_data = &state;
  jpeg_create_decompress(&state.jpeg);
  state.progress.progress_monitor = [](j_common_ptr jpeg) {
    if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number <= most_scans) return;
    State::of(jpeg).damaged = true;
    jpeg->err->msg_code = JWRN_BOGUS_PROGRESSION;
    std::longjmp(State::of(jpeg).escape, 1);
  };
  state.jpeg.progress = &state.progress;
  if (keep == Keep::exif) jpeg_save_markers(&state.jpeg, JPEG_APP0 + 1, 0xffff);
}

JpegReader::~JpegReader() {
  jpeg_destroy_decompress(&state_->jpeg);
}

JpegFault JpegReader::open(std::span<const std::uint8_t> bytes) {
  State& state = *state_;
  state.forget_faults();
  state.bytes = bytes;
  state.bytes_read = 0;
  if (bytes.empty()) return JpegFault::no_image;
  if (setjmp(state.escape) != 0) {
    jpeg_abort_decompress(&state.jpeg);
    return state.fatal();
  }
  jpeg_abort_decompress(&state.jpeg);  // of an image that was opened and not decoded
  jpeg_mem_src(&state.jpeg, bytes.data(), bytes.size());
  jpeg_read_header(&state.jpeg, TRUE);
  state.header = {state.jpeg.image_width, state.jpeg.image_height, state.jpeg.num_components};
  return JpegFault::none;
}

const JpegReader::Header& JpegReader::header() const {
  return state_->header;
}

std::span<const std::uint8_t> JpegReader::exif() const {
  for (const jpeg_marker_struct* marker = state_->jpeg.marker_list; marker != nullptr; marker = marker->next)
    if (marker->data_length > exif_name.size() &&
        std::equal(exif_name.begin(), exif_name.end(), marker->data))
      return {marker->data + exif_name.size(), marker->data_length - exif_name.size()};
  return {};
}

JpegFault JpegReader::decode(cv::Mat& picture) {
  State& state = *state_;
  jpeg_decompress_struct& jpeg = state.jpeg;
  if (static_cast<std::uint32_t>(picture.cols) != state.header.width ||
      static_cast<std::uint32_t>(picture.rows) != state.header.height)
    throw std::invalid_argument("the image is " + std::to_string(state.header.width) + "x" +
                                std::to_string(state.header.height) + ", the picture " +
                                std::to_string(picture.cols) + "x" + std::to_string(picture.rows));
  const bool inks = state.header.components == 4;
  if (inks && picture.channels() != 3) return JpegFault::unsupported;
  if (inks) state.inks.resize(std::size_t{state.header.width} * 4);
  if (setjmp(state.escape) != 0) {
    jpeg_abort_decompress(&jpeg);
    return state.fatal();
  }
  jpeg.out_color_space = inks ? JCS_CMYK : (picture.channels() == 3 ? JCS_EXT_BGR : JCS_GRAYSCALE);
  jpeg_start_decompress(&jpeg);
  while (jpeg.output_scanline < jpeg.output_height) {
    std::uint8_t* const to = picture.data + jpeg.output_scanline * picture.step[0];
    JSAMPROW row = inks ? state.inks.data() : to;
    jpeg_read_scanlines(&jpeg, &row, 1);
    if (inks) convert_inks(row, to, jpeg.output_width, jpeg.saw_Adobe_marker == FALSE);
  }
  const bool scans_missing = state.scans_missing();
  jpeg_finish_decompress(&jpeg);
  state.bytes_read = state.bytes.size() - std::min(jpeg.src->bytes_in_buffer, state.bytes.size());
  const JpegFault fault = state.fault();
  if (scans_missing && (fault == JpegFault::none || fault > JpegFault::missing_scans))
    return JpegFault::missing_scans;
  return fault;
}

std::size_t JpegReader::bytes_read() const {
  return state_->bytes_read;
}

}  // namespace eigenpose
