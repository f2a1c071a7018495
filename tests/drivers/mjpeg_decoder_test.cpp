// MJPEG as cameras send it: what is borne, and what is wrong with the rest.

#include "drivers/v4l2/mjpeg_decoder.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "tests/support/jpeg_bytes.h"

namespace eigenpose::test {
namespace {

cv::Mat slopes(int rows, int cols) {
  cv::Mat picture(rows, cols, CV_8UC3);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x)
      picture.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(2 * x), static_cast<std::uint8_t>(3 * y),
                                     static_cast<std::uint8_t>(90 + (x * y) % 5)};
  return picture;
}

constexpr int rows = 48, cols = 64;

/// What a decoder makes of a frame of 64 × 48.
struct Seen {
  FrameFault fault = FrameFault::none;
  cv::Mat picture;
};

Seen seen_of(const ByteList& frame, int type = CV_8UC3, int height = rows, int width = cols) {
  MjpegDecoder decoder;
  Seen seen;
  seen.picture = cv::Mat(height, width, type, cv::Scalar::all(1));
  seen.fault = decoder.decode(frame, seen.picture);
  return seen;
}

double difference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_INF);
}

ByteList from(const ByteList& bytes, std::size_t at) {
  return {bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end()};
}

/// With an APP0 segment "AVI1" in front, as Open-DML MJPEG has it.
ByteList with_avi1(const ByteList& jpeg, unsigned char polarity) {
  const ByteList segment = bytes_of("AVI1") + ByteList{polarity, 0} + ByteList(8);
  return cut(jpeg, 2) + ByteList{0xff, 0xe0} + big(segment.size() + 2, 2) + segment + from(jpeg, 2);
}

/// Without the segments of one kind.
ByteList without(const ByteList& jpeg, unsigned char kind) {
  ByteList rest = cut(jpeg, 2);
  std::size_t at = 2;
  while (jpeg.at(at + 1) != 0xda) {
    const std::size_t length = 2U + jpeg.at(at + 2) * 256U + jpeg.at(at + 3);
    if (jpeg[at + 1] != kind)
      rest = rest + ByteList(jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                             jpeg.begin() + static_cast<std::ptrdiff_t>(at + length));
    at += length;
  }
  return rest + from(jpeg, at);
}

TEST(MjpegDecoder, EverySamplingOfColourIsRead) {
  for (const auto& [across, down] : {std::pair{2, 1}, std::pair{2, 2}, std::pair{1, 1}, std::pair{1, 2}}) {
    const ByteList frame = jpeg_of(slopes(rows, cols), {.across = across, .down = down});
    const Seen color = seen_of(frame);
    ASSERT_EQ(color.fault, FrameFault::none);
    EXPECT_LE(cv::norm(color.picture, slopes(rows, cols), cv::NORM_L1) / (3.0 * rows * cols), 2.5);
    cv::Mat grey;
    cv::cvtColor(slopes(rows, cols), grey, cv::COLOR_BGR2GRAY);
    const Seen luma = seen_of(frame, CV_8UC1);
    ASSERT_EQ(luma.fault, FrameFault::none);
    EXPECT_LE(difference(luma.picture, grey), 8.0);
  }
}

TEST(MjpegDecoder, AGreyImageGivesGreyAndColourPictures) {
  const cv::Mat grey(rows, cols, CV_8UC1, cv::Scalar(77));
  const ByteList frame = jpeg_of(grey, {.colors = JCS_GRAYSCALE});
  EXPECT_LE(difference(seen_of(frame, CV_8UC1).picture, grey), 1.0);
  EXPECT_LE(difference(seen_of(frame).picture, cv::Mat(rows, cols, CV_8UC3, cv::Scalar::all(77))), 1.0);
}

TEST(MjpegDecoder, SizesThatAreNoMultipleOfABlockAreRead) {
  for (const auto& [height, width] : {std::pair{17, 33}, std::pair{1, 1}, std::pair{45, 63}}) {
    const Seen seen = seen_of(jpeg_of(slopes(height, width)), CV_8UC3, height, width);
    EXPECT_EQ(seen.fault, FrameFault::none) << width << "x" << height;
    EXPECT_LE(cv::norm(seen.picture, slopes(height, width), cv::NORM_L1) / (3.0 * height * width), 3.0);
  }
}

TEST(MjpegDecoder, WhatChangesNoPixelIsBorne) {
  const ByteList whole = jpeg_of(slopes(rows, cols), {.restart_blocks = 2});
  const cv::Mat picture = seen_of(whole).picture;
  const std::size_t restart = behind_marker(whole, 0xd0) - 2;
  const std::size_t second = behind_marker(whole, 0xd1) - 2;
  const std::vector<std::pair<const char*, ByteList>> frames = {
      {"no Huffman tables", without(whole, 0xc4)},
      {"AVI1", with_avi1(without(whole, 0xe0), 0)},
      {"a stray byte before a restart marker", cut(whole, restart) + ByteList{0x2a} + from(whole, restart)},
      {"stray bytes before each", cut(whole, restart) + ByteList(3, 0x55) +
                                      ByteList(whole.begin() + static_cast<std::ptrdiff_t>(restart),
                                               whole.begin() + static_cast<std::ptrdiff_t>(second)) +
                                      ByteList(15, 0) + from(whole, second)},
      {"fill bytes before a restart marker", cut(whole, restart) + ByteList(4, 0xff) + from(whole, restart)},
      {"a zero before the end", cut(whole, whole.size() - 2) + ByteList{0} + end_mark},
      {"no end", cut(whole, whole.size() - 2)},
      {"padding after the end", whole + ByteList(3000)},
      {"rubbish after the end", whole + ByteList(3000, 0x11)}};
  for (const auto& [what, frame] : frames) {
    const Seen seen = seen_of(frame);
    EXPECT_EQ(seen.fault, FrameFault::none) << what;
    EXPECT_EQ(difference(seen.picture, picture), 0.0) << what;
  }
}

TEST(MjpegDecoder, StrayBytesBeforeEveryRestartMarkerAreBorne) {
  constexpr int height = 480, width = 640;
  const ByteList whole = jpeg_of(slopes(height, width), {.restart_blocks = 1});
  const cv::Mat picture = seen_of(whole, CV_8UC3, height, width).picture;
  for (const std::size_t count : {std::size_t{1}, std::size_t{3}, std::size_t{9}}) {
    ByteList frame;
    for (std::size_t i = 0; i < whole.size(); ++i) {
      if (whole[i] == 0xff && i + 1 < whole.size() && whole[i + 1] >= 0xd0 && whole[i + 1] <= 0xd7)
        frame.insert(frame.end(), count, 0x2a);
      frame.push_back(whole[i]);
    }
    ASSERT_GT(frame.size(), whole.size() + 1000 * count) << "there are many restart markers";
    const Seen seen = seen_of(frame, CV_8UC3, height, width);
    EXPECT_EQ(seen.fault, FrameFault::none) << count;
    EXPECT_EQ(difference(seen.picture, picture), 0.0) << count;
  }
}

TEST(MjpegDecoder, SaysWhyAFrameCannotBeUsed) {
  const ByteList whole = jpeg_of(slopes(rows, cols), {.restart_blocks = 2});
  EXPECT_EQ(seen_of({}).fault, FrameFault::too_short);
  EXPECT_EQ(seen_of(ByteList(3000)).fault, FrameFault::no_image);
  EXPECT_EQ(seen_of(bytes_of("GIF89a")).fault, FrameFault::no_image);
  EXPECT_EQ(seen_of(jpeg_of(slopes(rows, cols + 1))).fault, FrameFault::wrong_size);
  EXPECT_EQ(seen_of(jpeg_of(slopes(rows + 1, cols))).fault, FrameFault::wrong_size);
  EXPECT_EQ(seen_of(cut(whole, whole.size() / 2)).fault, FrameFault::cut_short);
  EXPECT_EQ(seen_of(cut(whole, whole.size() / 2) + end_mark).fault, FrameFault::cut_short);
  EXPECT_EQ(
      seen_of(jpeg_of(cv::Mat(rows, cols, CV_8UC4, cv::Scalar::all(9)), {.colors = JCS_CMYK}), CV_8UC1).fault,
      FrameFault::unsupported);
  ByteList out_of_order = whole;
  out_of_order[behind_marker(whole, 0xd1) - 1] = 0xd4;
  EXPECT_EQ(seen_of(out_of_order).fault, FrameFault::damaged_data);
  const std::size_t restart = behind_marker(whole, 0xd0) - 2;
  EXPECT_EQ(seen_of(cut(whole, restart) + ByteList(512, 0x2a) + from(whole, restart)).fault,
            FrameFault::damaged_data);
}

TEST(MjpegDecoder, CutAnywhereAFrameIsUsedOnlyWithAllItsPixels) {
  const ByteList whole = jpeg_of(slopes(rows, cols), {.restart_blocks = 2});
  const cv::Mat picture = seen_of(whole).picture;
  for (std::size_t keep = 0; keep < whole.size(); ++keep) {
    const Seen seen = seen_of(cut(whole, keep));
    if (seen.fault == FrameFault::none) {
      EXPECT_EQ(difference(seen.picture, picture), 0.0) << keep;
    }
  }
}

/// A frame whose even rows come from one picture and whose odd rows from another.
cv::Mat woven(const cv::Mat& even, const cv::Mat& odd) {
  cv::Mat frame(2 * even.rows, even.cols, even.type());
  for (int y = 0; y < even.rows; ++y) {
    even.row(y).copyTo(frame.row(2 * y));
    odd.row(y).copyTo(frame.row(2 * y + 1));
  }
  return frame;
}

TEST(MjpegDecoder, TwoFieldsInOneBufferAreWovenInTheirOrder) {
  const cv::Mat bright(rows / 2, cols, CV_8UC3, cv::Scalar::all(200));
  const cv::Mat dark(rows / 2, cols, CV_8UC3, cv::Scalar::all(40));
  const ByteList first = without(jpeg_of(bright), 0xe0);
  const ByteList second = without(jpeg_of(dark), 0xe0);
  for (const int type : {CV_8UC3, CV_8UC1}) {
    cv::Mat upper_first = woven(bright, dark), lower_first = woven(dark, bright);
    if (type == CV_8UC1) {
      cv::cvtColor(upper_first, upper_first, cv::COLOR_BGR2GRAY);
      cv::cvtColor(lower_first, lower_first, cv::COLOR_BGR2GRAY);
    }
    EXPECT_LE(difference(seen_of(first + second, type).picture, upper_first), 2.0);
    EXPECT_LE(difference(seen_of(with_avi1(first, 1) + with_avi1(second, 2), type).picture, upper_first),
              2.0);
    EXPECT_LE(difference(seen_of(with_avi1(first, 2) + ByteList(32) + with_avi1(second, 1), type).picture,
                         lower_first),
              2.0);
  }
  EXPECT_EQ(seen_of(first + second).fault, FrameFault::none);
  EXPECT_EQ(seen_of(first).fault, FrameFault::cut_short) << "one field alone";
  EXPECT_EQ(seen_of(first + cut(second, second.size() / 2)).fault, FrameFault::cut_short);
  EXPECT_EQ(seen_of(cut(first, first.size() - 10) + second).fault, FrameFault::cut_short);
  EXPECT_EQ(seen_of(first + jpeg_of(slopes(rows, cols))).fault, FrameFault::wrong_size);
}

TEST(MjpegDecoder, DecodesTheNextFrameAfterADamagedOne) {
  const ByteList whole = jpeg_of(slopes(rows, cols));
  MjpegDecoder decoder;
  cv::Mat picture(rows, cols, CV_8UC3);
  for (const ByteList& damaged : {ByteList{}, ByteList(100), cut(whole, whole.size() / 2), cut(whole, 30)}) {
    EXPECT_NE(decoder.decode(damaged, picture), FrameFault::none);
    EXPECT_EQ(decoder.decode(whole, picture), FrameFault::none);
  }
}

}  // namespace
}  // namespace eigenpose::test
