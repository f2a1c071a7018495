// PNG as https://www.w3.org/TR/png-3/ has it: bit depths, transparency, interlacing, orientation, damage.

#include <gmock/gmock.h>

#include "tests/support/picture_bytes.h"

namespace eigenpose::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// One row of pixels, unfiltered.
ByteList png_row(const ByteList& bytes) {
  return ByteList{0} + bytes;
}

TEST(PngFile, GreyOfFewBitsIsScaledToTheFullRange) {
  EXPECT_THAT(samples_of(png_of({8, 1, 1, 0, png_row({0b10110001})})),
              ElementsAre(CV_8UC1, 255, 0, 255, 255, 0, 0, 0, 255));
  EXPECT_THAT(samples_of(png_of({4, 1, 2, 0, png_row({0b00011011})})), ElementsAre(CV_8UC1, 0, 85, 170, 255));
  EXPECT_THAT(samples_of(png_of({3, 1, 4, 0, png_row({0x08, 0xf0})})), ElementsAre(CV_8UC1, 0, 136, 255));
  EXPECT_THAT(samples_of(png_of({2, 1, 8, 0, png_row({7, 255})})), ElementsAre(CV_8UC1, 7, 255));
}

TEST(PngFile, GreyOf16BitsKeepsAllOfThem) {
  EXPECT_THAT(samples_of(png_of({2, 1, 16, 0, png_row({0x12, 0x34, 0xff, 0xfe})})),
              ElementsAre(CV_16UC1, 0x1234, 0xfffe));
}

TEST(PngFile, ColourOf16BitsBecomes8) {
  EXPECT_THAT(samples_of(png_of({1, 1, 16, 2, png_row({0xff, 0xff, 0x80, 0x80, 0x00, 0x81})})),
              ElementsAre(CV_8UC3, 255, 128, 1));
}

TEST(PngFile, APaletteOfEveryDepthGivesItsColours) {
  const ByteList colors = png_chunk("PLTE", {10, 20, 30, 40, 50, 60});
  for (const int bits : {1, 2, 4, 8}) {
    const auto packed = static_cast<unsigned char>(bits == 8 ? 0 : 1 << (8 - 2 * bits));
    const ByteList row = bits == 8 ? ByteList{0, 1} : ByteList{packed};
    EXPECT_THAT(samples_of(png_of({2, 1, bits, 3, png_row(row), colors})),
                ElementsAre(CV_8UC3, 10, 20, 30, 40, 50, 60))
        << bits;
  }
}

TEST(PngFile, APaletteIndexWithoutAColourIsDamage) {
  const ByteList colors = png_chunk("PLTE", {10, 20, 30, 40, 50, 60});
  EXPECT_THAT(refusal(png_of({2, 1, 8, 3, png_row({0, 2}), colors})), HasSubstr("palette"));
}

TEST(PngFile, WhatIsTransparentIsBlack) {
  const ByteList colors = png_chunk("PLTE", {200, 100, 50, 255, 255, 255, 9, 8, 7});
  EXPECT_THAT(samples_of(png_of({3, 1, 8, 3, png_row({0, 1, 2}), colors + png_chunk("tRNS", {128, 0})})),
              ElementsAre(CV_8UC3, 100, 50, 25, 0, 0, 0, 9, 8, 7))
      << "palette";
  EXPECT_THAT(samples_of(png_of({2, 1, 8, 0, png_row({255, 254}), png_chunk("tRNS", {0, 255})})),
              ElementsAre(CV_8UC1, 0, 254))
      << "colour key of grey";
  EXPECT_THAT(samples_of(png_of({2, 1, 4, 0, png_row({0xfe}), png_chunk("tRNS", {0, 15})})),
              ElementsAre(CV_8UC1, 0, 238))
      << "colour key of 4-bit grey";
  EXPECT_THAT(
      samples_of(png_of({2, 1, 16, 0, png_row({0x12, 0x34, 0x12, 0x35}), png_chunk("tRNS", {0x12, 0x34})})),
      ElementsAre(CV_16UC1, 0, 0x1235))
      << "colour key of 16-bit grey";
  EXPECT_THAT(samples_of(png_of({2, 1, 8, 2, png_row({255, 255, 255, 255, 255, 254}),
                                 png_chunk("tRNS", {0, 255, 0, 255, 0, 255})})),
              ElementsAre(CV_8UC3, 0, 0, 0, 255, 255, 254))
      << "colour key of RGB";
  EXPECT_THAT(samples_of(png_of({3, 1, 8, 4, png_row({255, 0, 200, 255, 201, 128})})),
              ElementsAre(CV_8UC1, 0, 200, 101))
      << "grey and alpha";
  EXPECT_THAT(samples_of(png_of({1, 1, 16, 4, png_row({0xff, 0xff, 0x80, 0x00})})),
              ElementsAre(CV_16UC1, 0x8000))
      << "16-bit grey and alpha";
  EXPECT_THAT(samples_of(png_of({2, 1, 8, 6, png_row({255, 255, 255, 0, 30, 20, 10, 255})})),
              ElementsAre(CV_8UC3, 0, 0, 0, 30, 20, 10))
      << "RGBA";
  EXPECT_THAT(samples_of(png_of({1, 1, 16, 6, png_row({0xff, 0xff, 0x80, 0x80, 0, 0, 0x7f, 0xff})})),
              ElementsAre(CV_8UC3, 127, 64, 0))
      << "16-bit RGBA";
}

TEST(PngFile, InterlacedPixelsFindTheirPlaces) {
  // Adam7 of 3 × 2: pass 1 has (0, 0), pass 5 none, pass 6 has (1, 0), pass 4 (2, 0), pass 7 row 1.
  const ByteList passes = png_row({1}) + png_row({3}) + png_row({2}) + png_row({4, 5, 6});
  EXPECT_THAT(samples_of(png_of({3, 2, 8, 0, passes, {}, 1})), ElementsAre(CV_8UC1, 1, 2, 3, 4, 5, 6));
}

TEST(PngFile, EveryFilterIsUndone) {
  const ByteList rows{0, 10, 20, 1, 5, 5, 2, 1, 1, 3, 3, 3, 4, 1, 1};
  // None; Sub: 5, 10; Up: 6, 11; Average: 3 + 3 = 6, 3 + (6 + 11) / 2 = 11; Paeth: 1 + 6 = 7, 1 + 11 = 12.
  EXPECT_THAT(samples_of(png_of({2, 5, 8, 0, rows})),
              ElementsAre(CV_8UC1, 10, 20, 5, 10, 6, 11, 6, 11, 7, 12));
}

TEST(PngFile, GammaAndProfilesChangeNothing) {
  const ByteList remarks = png_chunk("gAMA", big(45455, 4)) + png_chunk("sBIT", {5}) +
                           png_chunk("tEXt", bytes_of(std::string("Comment\0hello", 13)));
  EXPECT_THAT(samples_of(png_of({2, 1, 8, 0, png_row({7, 130}), remarks})), ElementsAre(CV_8UC1, 7, 130));
}

TEST(PngFile, OrientationIsAppliedWhicheverByteOrder) {
  for (int orientation = 0; orientation <= 9; ++orientation)
    for (const bool big_endian : {false, true}) {
      const ByteList exif = png_chunk("eXIf", exif_of(static_cast<std::uint32_t>(orientation), big_endian));
      const cv::Mat picture =
          decode_picture(png_of({3, 2, 8, 0, png_row({1, 2, 3}) + png_row({4, 5, 6}), exif}), "view");
      const cv::Mat wanted = as_seen(orientation);
      ASSERT_EQ(picture.size(), wanted.size()) << orientation;
      EXPECT_EQ(cv::norm(picture, wanted, cv::NORM_INF), 0.0) << orientation;
    }
}

TEST(PngFile, DamagedExifDoesNotDamageThePicture) {
  for (const ByteList& exif :
       {ByteList{}, bytes_of("II"), bytes_of("MM\0*\xff\xff\xff\xff"), cut(exif_of(6), 20)})
    EXPECT_EQ(refusal(png_of({1, 1, 8, 0, png_row({7}), png_chunk("eXIf", exif)})), "accepted");
}

TEST(PngFile, DataThatEndsBeforeTheLastPixelIsDamage) {
  const ByteList row = png_row({1, 2, 3});
  EXPECT_THAT(refusal(png_of({3, 2, 8, 0, row})), HasSubstr("damaged"))
      << "a row too few, every checksum right";
  EXPECT_THAT(refusal(png_of({3, 2, 8, 0, row + cut(row, 3)})), HasSubstr("damaged"));
  EXPECT_EQ(refusal(png_of({3, 2, 8, 0, row + row})), "accepted");
  EXPECT_EQ(refusal(png_of({3, 2, 8, 0, row + row}) + ByteList(100, 0x55)), "accepted")
      << "bytes after the end";
}

TEST(PngFile, AFilterOrHeaderThatDoesNotExistIsDamage) {
  EXPECT_NE(refusal(png_of({1, 1, 8, 0, {5, 7}})), "accepted") << "filter 5";
  EXPECT_NE(refusal(png_of({1, 1, 3, 0, {0, 7}})), "accepted") << "3 bits";
  EXPECT_NE(refusal(png_of({1, 1, 8, 1, {0, 7}})), "accepted") << "colour type 1";
  EXPECT_NE(refusal(png_of({1, 1, 8, 3, {0, 0}})), "accepted") << "no palette";
  EXPECT_NE(refusal(png_of({0, 1, 8, 0, {0}})), "accepted") << "no columns";
  EXPECT_NE(refusal(png_of({1, 0, 8, 0, {}})), "accepted") << "no rows";
  EXPECT_NE(refusal(bytes_of("\x89PNG\r\n\x1a\n") + png_chunk("IEND", {})), "accepted");
}

TEST(PngFile, TheSizeIsCheckedBeforeAnythingIsDecoded) {
  for (const std::uint32_t width : {32'000U, 0x7fffffffU, 0xffffffffU})
    EXPECT_THAT(refusal(png_of({width, 32'000, 8, 3, {}, png_chunk("PLTE", {1, 2, 3})})),
                HasSubstr("too large"));
}

}  // namespace
}  // namespace eigenpose::test
