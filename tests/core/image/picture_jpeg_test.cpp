// JPEG as ITU-T T.81 has it, in files: kinds, orientation, what is whole and what is damaged.

#include <algorithm>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include "core/image/jpeg_reader.h"
#include "tests/support/jpeg_bytes.h"

namespace eigenpose::test {
namespace {

using ::testing::HasSubstr;

cv::Mat slopes(int rows = 45, int cols = 61) {
  cv::Mat picture(rows, cols, CV_8UC3);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x)
      picture.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(5 * y),
                                     static_cast<std::uint8_t>(90 + (x * y) % 7)};
  return picture;
}

cv::Mat grey_slopes() {
  cv::Mat grey;
  cv::cvtColor(slopes(), grey, cv::COLOR_BGR2GRAY);
  return grey;
}

TEST(JpegFile, EveryKindGivesItsPixels) {
  for (const JpegParts& parts : {JpegParts{}, JpegParts{.progressive = true},
                                 JpegParts{.separate_scans = true}, JpegParts{.restart_blocks = 2}}) {
    const cv::Mat picture = decode_picture(jpeg_of(slopes(), parts), "view");
    ASSERT_EQ(picture.type(), CV_8UC3);
    // Colour is kept at half the resolution: a slope of 4 levels a pixel is off by up to 8 at the edge.
    EXPECT_LE(cv::norm(picture, slopes(), cv::NORM_INF), 16.0);
    EXPECT_LE(cv::norm(picture, slopes(), cv::NORM_L1) / static_cast<double>(picture.total() * 3), 3.0);
  }
  for (const bool progressive : {false, true}) {
    const cv::Mat picture =
        decode_picture(jpeg_of(grey_slopes(), {.colors = JCS_GRAYSCALE, .progressive = progressive}), "view");
    ASSERT_EQ(picture.type(), CV_8UC1);
    EXPECT_LE(cv::norm(picture, grey_slopes(), cv::NORM_INF), 8.0);
  }
}

TEST(JpegFile, InksBecomeColoursWhicheverWayTheyCount) {
  for (const bool adobe : {true, false}) {
    // Cyan none, magenta all, yellow none, black 155 of 255. Adobe counts what is left of white.
    const cv::Vec4b ink(0, 255, 0, 155);
    const cv::Vec4b written = adobe ? cv::Vec4b(255, 0, 255, 100) : ink;
    const cv::Mat inks(16, 16, CV_8UC4, cv::Scalar(written[0], written[1], written[2], written[3]));
    const cv::Mat picture = decode_picture(jpeg_of(inks, {.colors = JCS_CMYK, .adobe = adobe}), "view");
    ASSERT_EQ(picture.type(), CV_8UC3);
    EXPECT_LE(cv::norm(picture, cv::Mat(16, 16, CV_8UC3, cv::Scalar(100, 0, 100)), cv::NORM_INF), 3.0)
        << adobe;
  }
}

TEST(JpegFile, OrientationIsApplied) {
  // Blocks of 8 × 8, so that each of the six values of the common example keeps its place.
  cv::Mat large;
  cv::resize(as_seen(1) * 40, large, {24, 16}, 0, 0, cv::INTER_NEAREST);
  const ByteList jpeg = jpeg_of(large, {.colors = JCS_GRAYSCALE});
  for (std::uint32_t orientation = 0; orientation <= 9; ++orientation)
    for (const bool big_endian : {false, true}) {
      const ByteList exif = bytes_of({"Exif\0\0", 6}) + exif_of(orientation, big_endian);
      const ByteList file = cut(jpeg, 2) + ByteList{0xff, 0xe1} + big(exif.size() + 2, 2) + exif +
                            ByteList(jpeg.begin() + 2, jpeg.end());
      const cv::Mat picture = decode_picture(file, "view");
      cv::Mat wanted;
      const cv::Mat seen = as_seen(static_cast<int>(orientation)) * 40;
      cv::resize(seen, wanted, seen.size() * 8, 0, 0, cv::INTER_NEAREST);
      ASSERT_EQ(picture.size(), wanted.size()) << orientation;
      EXPECT_LE(cv::norm(picture, wanted, cv::NORM_INF), 3.0) << orientation;
    }
}

TEST(JpegFile, BytesAfterTheEndAreIgnored) {
  const ByteList jpeg = jpeg_of(slopes());
  EXPECT_EQ(refusal(jpeg + ByteList(100)), "accepted");
  EXPECT_EQ(refusal(jpeg +
                    bytes_of({"\0\0\0\x18"
                              "ftypmp42",
                              12}) +
                    ByteList(8000, 0x11)),
            "accepted")
      << "a motion photo";
  EXPECT_EQ(refusal(jpeg + jpeg_of(grey_slopes(), {.colors = JCS_GRAYSCALE})), "accepted") << "a preview";
}

TEST(JpegFile, CutAnywhereItIsRefused) {
  for (const JpegParts& parts : {JpegParts{}, JpegParts{.progressive = true},
                                 JpegParts{.separate_scans = true}, JpegParts{.restart_blocks = 2}}) {
    const ByteList jpeg = jpeg_of(slopes(), parts);
    for (std::size_t keep = 2; keep < jpeg.size(); ++keep)
      ASSERT_NE(refusal(cut(jpeg, keep)), "accepted") << keep << " of " << jpeg.size();
  }
}

TEST(JpegFile, CutAnywhereAndGivenAnEndMarkItIsRefused) {
  for (const JpegParts& parts : {JpegParts{}, JpegParts{.progressive = true},
                                 JpegParts{.separate_scans = true}, JpegParts{.restart_blocks = 2}}) {
    const ByteList jpeg = jpeg_of(slopes(), parts);
    const cv::Mat whole = decode_picture(jpeg, "view");
    for (std::size_t keep = 2; keep + 2 < jpeg.size(); ++keep) {
      const ByteList mended = cut(jpeg, keep) + end_mark;
      if (refusal(mended) != "accepted") continue;
      // The last byte may hold nothing but the padding of the last block: then no pixel is missing.
      EXPECT_GE(keep + 4, jpeg.size()) << "of " << jpeg.size();
      EXPECT_EQ(cv::norm(decode_picture(mended, "view"), whole, cv::NORM_INF), 0.0) << keep;
    }
  }
}

TEST(JpegFile, ScansThatAreMissingAreNoticed) {
  const ByteList progressive = jpeg_of(slopes(), {.progressive = true});
  const ByteList separate = jpeg_of(slopes(), {.separate_scans = true});
  for (const ByteList& jpeg : {progressive, separate}) {
    const std::size_t first = behind_marker(jpeg, 0xda);
    const std::size_t second = behind_marker(jpeg, 0xda, first) - 2;
    std::size_t end_of_first = second;  // tables may stand between the scans
    for (std::size_t at = first; at < second; ++at)
      if (jpeg[at] == 0xff && jpeg[at + 1] == 0xc4) end_of_first = std::min(end_of_first, at);
    EXPECT_THAT(refusal(cut(jpeg, end_of_first) + end_mark), HasSubstr("scans are missing"));
  }
}

TEST(JpegFile, RestartMarkersOutOfOrderAreDamage) {
  ByteList jpeg = jpeg_of(slopes(), {.restart_blocks = 1});
  const std::size_t at = behind_marker(jpeg, 0xd2);
  jpeg[at - 1] = 0xd5;
  EXPECT_THAT(refusal(jpeg), HasSubstr("JPEG data cannot be decoded"));
}

TEST(JpegFile, FewStrayBytesBeforeAMarkerAreBorneAndManyAreNot) {
  const ByteList jpeg = jpeg_of(slopes(), {.restart_blocks = 4});
  const std::size_t restart = behind_marker(jpeg, 0xd0) - 2;
  const auto with = [&](std::size_t count) {
    return cut(jpeg, restart) + ByteList(count, 0x2a) +
           ByteList(jpeg.begin() + static_cast<std::ptrdiff_t>(restart), jpeg.end());
  };
  for (const std::size_t count : {std::size_t{1}, std::size_t{16}}) {
    ASSERT_EQ(refusal(with(count)), "accepted") << count;
    EXPECT_EQ(cv::norm(decode_picture(with(count), "view"), decode_picture(jpeg, "view"), cv::NORM_INF), 0.0);
  }
  EXPECT_NE(refusal(with(64)), "accepted");
}

TEST(JpegFile, KindsThatAreNotReadAreNamed) {
  ByteList jpeg = jpeg_of(slopes());
  const std::size_t frame = behind_marker(jpeg, 0xc0);
  ByteList twelve_bits = jpeg;
  twelve_bits[frame + 2] = 12;
  EXPECT_THAT(refusal(twelve_bits), HasSubstr("12 bits or lossless"));
  jpeg[frame - 1] = 0xc3;
  EXPECT_THAT(refusal(jpeg), HasSubstr("12 bits or lossless"));
}

TEST(JpegFile, TheSizeIsCheckedBeforeAnythingIsDecoded) {
  ByteList jpeg = jpeg_of(slopes());
  const std::size_t frame = behind_marker(jpeg, 0xc0);
  for (std::size_t i = 0; i < 4; ++i) jpeg[frame + 3 + i] = i % 2 == 0 ? 0x7d : 0x00;  // 32000 × 32000
  EXPECT_THAT(refusal(jpeg), HasSubstr("too large"));
  for (std::size_t i = 0; i < 4; ++i) jpeg[frame + 3 + i] = 0;
  EXPECT_NE(refusal(jpeg), "accepted");
}

TEST(JpegFile, ManyEmptyScansAreRefusedSoon) {
  const ByteList jpeg = jpeg_of(slopes(), {.progressive = true});
  const std::size_t scan = behind_marker(jpeg, 0xda) - 2;
  const std::size_t header = 2U + jpeg[scan + 2] * 256U + jpeg[scan + 3];
  ByteList bomb = cut(jpeg, scan);
  const ByteList empty(jpeg.begin() + static_cast<std::ptrdiff_t>(scan),
                       jpeg.begin() + static_cast<std::ptrdiff_t>(scan + header));
  for (int i = 0; i < 2000; ++i) bomb = bomb + empty;
  EXPECT_NE(refusal(bomb + end_mark), "accepted");
}

TEST(JpegReader, RefusesAPictureOfAnotherSize) {
  const ByteList jpeg = jpeg_of(slopes());
  JpegReader reader;
  ASSERT_EQ(reader.open(jpeg), JpegFault::none);
  cv::Mat small(8, 8, CV_8UC3);
  EXPECT_THROW(reader.decode(small), std::invalid_argument);
}

TEST(JpegReader, ReadsAWholeImageAfterADamagedOne) {
  const ByteList jpeg = jpeg_of(slopes());
  JpegReader reader;
  cv::Mat picture(slopes().size(), CV_8UC3);
  const ByteList most = cut(jpeg, jpeg.size() - 50);
  ASSERT_EQ(reader.open(most), JpegFault::none);
  EXPECT_EQ(reader.decode(picture), JpegFault::cut_short);
  ASSERT_EQ(reader.open(jpeg), JpegFault::none);
  EXPECT_EQ(reader.decode(picture), JpegFault::none);
  EXPECT_EQ(reader.bytes_read(), jpeg.size());
  EXPECT_EQ(reader.open({}), JpegFault::no_image);
  const ByteList text = bytes_of("hello");
  EXPECT_EQ(reader.open(text), JpegFault::no_image);
}

}  // namespace
}  // namespace eigenpose::test
