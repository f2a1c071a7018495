// PBM, PGM and PPM as the netpbm manual has them (pbm(5), pgm(5), ppm(5)).

#include <gmock/gmock.h>

#include "tests/support/picture_bytes.h"

namespace eigenpose::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<int> samples(std::string_view header, const ByteList& raster = {}) {
  return samples_of(bytes_of(header) + raster);
}

std::string refused(std::string_view header, const ByteList& raster = {}) {
  return refusal(bytes_of(header) + raster);
}

TEST(PnmFile, AOneOfABitmapIsBlack) {
  EXPECT_THAT(samples("P1\n3 2\n1 0 1\n0 1 0\n"), ElementsAre(CV_8UC1, 0, 255, 0, 255, 0, 255));
  EXPECT_THAT(samples("P1 3 2 101010"), ElementsAre(CV_8UC1, 0, 255, 0, 255, 0, 255)) << "bits need no space";
  EXPECT_THAT(samples("P4\n10 2\n", {0b10000000, 0b01111111, 0b00000000, 0b10000000}),
              ElementsAre(CV_8UC1, 0, 255, 255, 255, 255, 255, 255, 255, 255, 0,  //
                          255, 255, 255, 255, 255, 255, 255, 255, 0, 255))
      << "rows begin on bytes";
}

TEST(PnmFile, SamplesAreScaledFromTheMaxval) {
  EXPECT_THAT(samples("P2\n3 1\n1\n0 1 0\n"), ElementsAre(CV_8UC1, 0, 255, 0));
  EXPECT_THAT(samples("P5\n3 1\n100\n", {0, 50, 100}), ElementsAre(CV_8UC1, 0, 128, 255));
  EXPECT_THAT(samples("P5\n2 1\n255\n", {7, 255}), ElementsAre(CV_8UC1, 7, 255));
  EXPECT_THAT(samples("P5\n2 1\n256\n", {0, 128, 1, 0}), ElementsAre(CV_16UC1, 32768, 65535));
  EXPECT_THAT(samples("P5\n3 1\n4095\n", {0, 0, 8, 0, 15, 255}), ElementsAre(CV_16UC1, 0, 32776, 65535));
  EXPECT_THAT(samples("P5\n2 1\n65535\n", {0x12, 0x34, 255, 255}), ElementsAre(CV_16UC1, 0x1234, 65535));
  EXPECT_THAT(samples("P2\n2 1\n4095\n1 4095\n"), ElementsAre(CV_16UC1, 16, 65535));
  EXPECT_THAT(samples("P3\n1 1\n15\n15 0 5\n"), ElementsAre(CV_8UC3, 255, 0, 85));
  EXPECT_THAT(samples("P6\n1 1\n127\n", {127, 0, 64}), ElementsAre(CV_8UC3, 255, 0, 129));
  EXPECT_THAT(samples("P6\n1 1\n1023\n", {3, 255, 0, 0, 2, 0}), ElementsAre(CV_8UC3, 255, 0, 128));
}

TEST(PnmFile, AnyWhiteSpaceAndCommentsStandInTheHeader) {
  for (const char* header : {"P5 2 1 255 ", "P5\t2\r\n1\n\n255\n", "P5\v2\f1\r255\r", "P5#x\n2#y\n1#z\r255\n",
                             "P5\n# made by hand 7 8\n2 1\n255\n", "P5\n#\n#\n2 1\n# maxval\n255\n"})
    EXPECT_THAT(samples(header, {10, 13}), ElementsAre(CV_8UC1, 10, 13)) << header;
  EXPECT_THAT(samples("P2\n2 1\n255\n7 # seven\n8"), ElementsAre(CV_8UC1, 7, 8));
}

TEST(PnmFile, OneWhiteSpaceEndsTheHeaderAndTheRasterMayBeginWithMore) {
  EXPECT_THAT(samples("P5\n2 1\n255\n", bytes_of("\n ")), ElementsAre(CV_8UC1, 10, 32));
  EXPECT_THAT(samples("P5\n2 1\n255 ", bytes_of("#a")), ElementsAre(CV_8UC1, 35, 97));
  EXPECT_THAT(samples("P5\n2 1\n255#c\n\n", {10, 9}), ElementsAre(CV_8UC1, 10, 9));
  EXPECT_THAT(samples("P5\n2 1\n255#c\n", {10, 9}), ElementsAre(CV_8UC1, 10, 9));
}

TEST(PnmFile, OnlyTheFirstPictureOfSeveralIsRead) {
  EXPECT_THAT(samples("P5\n1 1\n255\n", bytes_of("aP5\n1 1\n255\nb")), ElementsAre(CV_8UC1, 'a'));
}

TEST(PnmFile, ARasterThatEndsEarlyIsTruncated) {
  EXPECT_THAT(refused("P5\n4 3\n255\n", ByteList(11)), HasSubstr("11 of 12 bytes"));
  EXPECT_THAT(refused("P5\n4 3\n256\n", ByteList(23)), HasSubstr("23 of 24 bytes"));
  EXPECT_THAT(refused("P6\n4 3\n255\n", ByteList(35)), HasSubstr("35 of 36 bytes"));
  EXPECT_THAT(refused("P4\n9 2\n", ByteList(3)), HasSubstr("3 of 4 bytes"));
  EXPECT_THAT(refused("P1\n4 2\n1010101"), HasSubstr("truncated"));
  EXPECT_THAT(refused("P2\n2 2\n255\n111 2 3"), HasSubstr("truncated"));
  EXPECT_THAT(refused("P3\n1 1\n255\n1 2"), HasSubstr("truncated"));
}

TEST(PnmFile, AHeaderThatMakesNoSenseIsRefused) {
  for (const char* text : {"P5\n", "P5\n2", "P5\n2 x 255\nab", "P5\n2 1\n", "P5\n2 1\n0\nab",
                           "P5\n2 1\n65536\nabcd", "P5\n-2 1\n255\nab", "P5\n0 1\n255\n", "P5\n1 0\n255\n",
                           "P5\n2 1\n255", "P5\n2 1\n255xab", "P5\n2.5 1\n255\nab"})
    EXPECT_NE(refused(text), "accepted") << text;
}

TEST(PnmFile, ASampleAboveTheMaxvalIsDamage) {
  EXPECT_THAT(refused("P5\n2 1\n100\n", {0, 101}), HasSubstr("largest is 100"));
  EXPECT_NE(refused("P2\n2 1\n100\n0 101"), "accepted");
  EXPECT_NE(refused("P5\n1 1\n4095\n", {16, 0}), "accepted");
  EXPECT_NE(refused("P1\n2 1\n1 2"), "accepted");
  EXPECT_NE(refused("P3\n1 1\n9\n1 2 10"), "accepted");
}

TEST(PnmFile, TheSizeIsCheckedBeforeAnythingIsDecoded) {
  EXPECT_THAT(refused("P5\n32000 32000\n255\n"), HasSubstr("too large"));
  EXPECT_THAT(refused("P5\n999999999 999999999\n255\n"), HasSubstr("too large"));
  EXPECT_THAT(refused("P4\n99999999999999999999 1\n"), HasSubstr("damaged"));
  EXPECT_THAT(refused("P2\n10000 10000\n255\n1 2 3"), HasSubstr("truncated"));
}

TEST(PnmFile, TextAndOtherKindsOfTheFamilyAreNoPictures) {
  for (const char* text : {"P0\n1 1\n255\na", "P7\nWIDTH 1\nHEIGHT 1\nDEPTH 1\nMAXVAL 255\nENDHDR\na",
                           "P8\n1 1\n", "Pf\n1 1\n-1.0\naaaa", "P5a", "P55 1 1 255 a", "P"})
    EXPECT_THAT(refused(text), HasSubstr("not a picture")) << text;
}

}  // namespace
}  // namespace eigenpose::test
