/// The netpbm formats PBM, PGM and PPM, plain (P1, P2, P3) and raw (P4, P5, P6).
/// https://netpbm.sourceforge.net/doc/pgm.html and its neighbours.

#include <optional>

#include "core/image/decoders/decoders.h"

namespace eigenpose::decoders {
namespace {

/// White space of the specification: blank, TAB, LF, VT, FF, CR.
bool is_space(unsigned char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

/// Reads the text part of a file: whole numbers between white space and comments.
class PnmText {
 public:
  PnmText(Bytes file, std::size_t at) : file_(file), at_(at) {}

  [[nodiscard]] std::size_t position() const { return at_; }

  /// The next whole number. A comment goes from # to the end of its line.
  std::uint32_t number(std::uint32_t largest, const char* name) {
    skip_space();
    std::uint64_t value = 0;
    const std::size_t first = at_;
    while (at_ < file_.size() && file_[at_] >= '0' && file_[at_] <= '9') {
      value = value * 10 + (file_[at_++] - '0');
      if (value > largest)
        refuse_damaged(std::string("its ") + name + " is more than " + std::to_string(largest));
    }
    if (at_ == first && at_ >= file_.size()) refuse_truncated(std::string("its ") + name + " is missing");
    if (at_ == first) refuse_damaged(std::string("its ") + name + " is not a number");
    return static_cast<std::uint32_t>(value);
  }

  /// The next 0 or 1, which need not be apart from each other.
  bool bit() {
    skip_space();
    if (at_ >= file_.size()) refuse_truncated("its last pixels are missing");
    const unsigned char digit = file_[at_++];
    if (digit != '0' && digit != '1') refuse_damaged("one of its pixels is neither 0 nor 1");
    return digit == '1';
  }

  /// The one white space between the header and the raster. Behind a comment its line end counts as such,
  /// unless another one follows, as the specification wants it.
  void end_header(std::uint64_t raster) {
    if (at_ >= file_.size()) refuse_truncated("it ends with its header");
    const bool comment = file_[at_] == '#';
    if (comment) skip_comment();
    const bool space = at_ < file_.size() && is_space(file_[at_]);
    if (space && (!comment || file_.size() - at_ > raster)) ++at_;
    if (!space && !comment) refuse_damaged("no white space ends its header");
  }

 private:
  void skip_comment() {
    while (at_ < file_.size() && file_[at_] != '\n' && file_[at_] != '\r') ++at_;
    if (at_ < file_.size()) ++at_;
  }
  void skip_space() {
    while (at_ < file_.size() && (is_space(file_[at_]) || file_[at_] == '#')) {
      if (file_[at_] == '#')
        skip_comment();
      else
        ++at_;
    }
  }

  Bytes file_;
  std::size_t at_;
};

struct PnmHeader {
  int kind = 0;  ///< the digit behind the P
  int width = 0;
  int height = 0;
  std::uint32_t largest = 1;  ///< maxval

  [[nodiscard]] bool plain() const { return kind <= 3; }
  [[nodiscard]] bool bitmap() const { return kind == 1 || kind == 4; }
  [[nodiscard]] int channels() const { return kind == 3 || kind == 6 ? 3 : 1; }
  [[nodiscard]] std::size_t row_bytes() const {
    const auto samples = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels());
    if (bitmap()) return (samples + 7) / 8;
    return largest > 255 ? 2 * samples : samples;
  }
};

/// One row of a raw file to samples.
void raw_row(const PnmHeader& header, const unsigned char* from, std::span<std::uint32_t> samples) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (header.bitmap())
      samples[i] = (from[i / 8] >> (7 - i % 8)) & 1U;
    else if (header.largest > 255)
      samples[i] = std::uint32_t{from[2 * i]} << 8U | from[2 * i + 1];
    else
      samples[i] = from[i];
  }
}

void plain_row(const PnmHeader& header, PnmText& text, std::span<std::uint32_t> samples) {
  for (std::uint32_t& sample : samples)
    sample =
        header.bitmap() ? static_cast<std::uint32_t>(text.bit()) : text.number(header.largest, "next sample");
}

/// Samples to pixels: scaled to the full range, ones of a bitmap to black, RGB to BGR.
void store_row(const PnmHeader& header, std::span<const std::uint32_t> samples, cv::Mat& pixels, int y) {
  const bool wide = pixels.depth() == CV_16U;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i] > header.largest)
      refuse_damaged("a sample of row " + std::to_string(y) + " is " + std::to_string(samples[i]) +
                     ", its largest is " + std::to_string(header.largest));
    const std::uint32_t value = header.bitmap() ? 1 - samples[i] : samples[i];
    const std::uint32_t scaled = rescaled(value, header.largest, wide ? 65535 : 255);
    const std::size_t to = header.channels() == 3 ? i + 2 - 2 * (i % 3) : i;
    if (wide)
      pixels.ptr<std::uint16_t>(y)[to] = static_cast<std::uint16_t>(scaled);
    else
      pixels.ptr<std::uint8_t>(y)[to] = static_cast<std::uint8_t>(scaled);
  }
}

}  // namespace

Decoded decode_pnm(Bytes file) {
  PnmHeader header;
  header.kind = file[1] - '0';
  PnmText text(file, 2);
  constexpr std::uint32_t longest_side = 1'000'000'000;
  const std::uint32_t width = text.number(longest_side, "width");
  const std::uint32_t height = text.number(longest_side, "height");
  check_size(width, height);
  header.width = static_cast<int>(width);
  header.height = static_cast<int>(height);
  if (!header.bitmap()) header.largest = text.number(65535, "maxval");
  if (header.largest == 0) refuse_damaged("its maxval is 0");

  const std::uint64_t raster = header.row_bytes() * std::uint64_t{height};
  if (!header.plain()) {
    text.end_header(raster);
    const std::uint64_t have = file.size() - text.position();
    if (have < raster)
      refuse_truncated(std::to_string(have) + " of " + std::to_string(raster) + " bytes of picture");
  } else if (const std::uint64_t least =
                 std::uint64_t{width} * height * static_cast<unsigned>(header.channels());
             file.size() - text.position() < least) {
    refuse_truncated("its last pixels are missing");  // each takes a digit: known before room is made
  }
  const int depth = header.largest > 255 && header.channels() == 1 ? CV_16U : CV_8U;
  cv::Mat pixels(header.height, header.width, CV_MAKETYPE(depth, header.channels()));
  std::vector<std::uint32_t> samples(static_cast<std::size_t>(width) *
                                     static_cast<std::size_t>(header.channels()));
  const unsigned char* row = file.data() + text.position();
  for (int y = 0; y < header.height; ++y, row += header.row_bytes()) {
    if (header.plain())
      plain_row(header, text, samples);
    else
      raw_row(header, row, samples);
    store_row(header, samples, pixels, y);
  }
  return {pixels, 1};
}

}  // namespace eigenpose::decoders
