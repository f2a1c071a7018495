// BMP as BITMAPFILEHEADER, BITMAPCOREHEADER, BITMAPINFOHEADER, BITMAPV4HEADER and BITMAPV5HEADER describe it.

#include <gmock/gmock.h>

#include "tests/support/picture_bytes.h"

namespace eigenpose::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct BmpParts {
  std::int32_t width = 0;
  std::int32_t height = 0;
  int bits = 0;
  int compression = 0;
  ByteList behind_header{};  ///< masks and palette; of V4 and V5 the masks are the header's
  ByteList data{};
  std::uint32_t colors = 0;
  std::uint32_t header = 40;
  std::vector<std::uint32_t> masks{};  ///< red, green, blue, alpha, of headers above 40 bytes
};

ByteList bmp_of(const BmpParts& parts) {
  ByteList header = little(parts.header, 4);
  if (parts.header == 12) {
    header = header + little(static_cast<std::uint32_t>(parts.width), 2) +
             little(static_cast<std::uint32_t>(parts.height), 2) + little(1, 2) +
             little(static_cast<std::uint32_t>(parts.bits), 2);
  } else {
    header = header + little(static_cast<std::uint32_t>(parts.width), 4) +
             little(static_cast<std::uint32_t>(parts.height), 4) + little(1, 2) +
             little(static_cast<std::uint32_t>(parts.bits), 2) +
             little(static_cast<std::uint32_t>(parts.compression), 4) + ByteList(12) +
             little(parts.colors, 4) + ByteList(4);
    for (const std::uint32_t mask : parts.masks) header = header + little(mask, 4);
    header.resize(parts.header);
  }
  const std::size_t at = 14 + header.size() + parts.behind_header.size();
  return bytes_of("BM") + little(at + parts.data.size(), 4) + ByteList(4) + little(at, 4) + header +
         parts.behind_header + parts.data;
}

const ByteList two_colors{30, 20, 10, 0, 60, 50, 40, 0};  // blue, green, red, nothing

TEST(BmpFile, RowsGoUpUnlessTheHeightIsNegative) {
  const ByteList rows{1, 2, 3, 0, 4, 5, 6, 0};
  EXPECT_THAT(samples_of(bmp_of({1, 2, 24, 0, {}, rows})), ElementsAre(CV_8UC3, 6, 5, 4, 3, 2, 1));
  EXPECT_THAT(samples_of(bmp_of({1, -2, 24, 0, {}, rows})), ElementsAre(CV_8UC3, 3, 2, 1, 6, 5, 4));
}

TEST(BmpFile, PaletteIndicesOfEveryDepthGiveTheirColours) {
  const std::vector<int> wanted{CV_8UC3, 10, 20, 30, 40, 50, 60, 10, 20, 30};
  EXPECT_EQ(samples_of(bmp_of({3, 1, 1, 0, two_colors, {0b01000000, 0, 0, 0}})), wanted);
  EXPECT_EQ(samples_of(bmp_of({3, 1, 2, 0, two_colors, {0b00010000, 0, 0, 0}, 2})), wanted);
  EXPECT_EQ(samples_of(bmp_of({3, 1, 4, 0, two_colors, {0x01, 0x00, 0, 0}, 2})), wanted);
  EXPECT_EQ(samples_of(bmp_of({3, 1, 8, 0, two_colors, {0, 1, 0, 0}, 2})), wanted);
}

TEST(BmpFile, APaletteOfGreysIsAGreyPicture) {
  EXPECT_THAT(samples_of(bmp_of({2, 1, 8, 0, {7, 7, 7, 0, 200, 200, 200, 0}, {1, 0, 0, 0}, 2})),
              ElementsAre(CV_8UC1, 200, 7));
}

TEST(BmpFile, OperatingSystem2HasShortHeadersAndPalettes) {
  EXPECT_THAT(samples_of(bmp_of({2, 1, 1, 0, {30, 20, 10, 60, 50, 40}, {0b10000000, 0, 0, 0}, 0, 12})),
              ElementsAre(CV_8UC3, 40, 50, 60, 10, 20, 30));
  EXPECT_THAT(samples_of(bmp_of({1, 1, 24, 0, {}, {1, 2, 3, 0}, 0, 64})), ElementsAre(CV_8UC3, 3, 2, 1));
}

TEST(BmpFile, SixteenBitsAreFiveForEachColourOrWhatTheMasksSay) {
  EXPECT_THAT(samples_of(bmp_of({2, 1, 16, 0, {}, {0x00, 0x7c, 0x1f, 0x02}})),
              ElementsAre(CV_8UC3, 255, 0, 0, 0, 132, 255));
  const ByteList masks565 = little(0xf800, 4) + little(0x07e0, 4) + little(0x001f, 4);
  EXPECT_THAT(samples_of(bmp_of({2, 1, 16, 3, masks565, {0xe0, 0x07, 0x01, 0x08}})),
              ElementsAre(CV_8UC3, 0, 255, 0, 8, 0, 8));
}

TEST(BmpFile, ThirtyTwoBitsIgnoreTheFourthByteUnlessAMaskNamesIt) {
  EXPECT_THAT(samples_of(bmp_of({1, 1, 32, 0, {}, {1, 2, 3, 0}})), ElementsAre(CV_8UC3, 3, 2, 1));
  const ByteList masks = little(0xff, 4) + little(0xff00, 4) + little(0xff0000, 4);
  EXPECT_THAT(samples_of(bmp_of({1, 1, 32, 3, masks, {1, 2, 3, 0}})), ElementsAre(CV_8UC3, 1, 2, 3));
  const ByteList ten_bits = little(0x3ff00000, 4) + little(0xffc00, 4) + little(0x3ff, 4);
  EXPECT_THAT(samples_of(bmp_of({1, 1, 32, 3, ten_bits, little(0x3ff00000U | 512U, 4)})),
              ElementsAre(CV_8UC3, 255, 0, 128));
}

TEST(BmpFile, WhatIsTransparentIsBlack) {
  const std::vector<std::uint32_t> masks{0xff0000, 0xff00, 0xff, 0xff000000};
  for (const std::uint32_t header : {56U, 108U, 124U})
    EXPECT_THAT(
        samples_of(bmp_of(
            {3, 1, 32, 3, {}, {255, 255, 255, 0, 10, 20, 30, 255, 100, 100, 100, 51}, 0, header, masks})),
        ElementsAre(CV_8UC3, 0, 0, 0, 30, 20, 10, 20, 20, 20))
        << header;
  const ByteList outside = little(0xff0000, 4) + little(0xff00, 4) + little(0xff, 4) + little(0xff000000, 4);
  EXPECT_THAT(samples_of(bmp_of({1, 1, 32, 6, outside, {255, 255, 255, 0}})), ElementsAre(CV_8UC3, 0, 0, 0));
  EXPECT_THAT(
      samples_of(bmp_of({1, 1, 16, 3, {}, {0xff, 0x7f, 0, 0}, 0, 108, {0x7c00, 0x3e0, 0x1f, 0x8000}})),
      ElementsAre(CV_8UC3, 0, 0, 0))
      << "one bit of alpha";
}

TEST(BmpFile, RunsOfEightBitsAreUnpacked) {
  // Two of 1; three literal (padded); end of line; skip one right; one of 1; end of bitmap.
  const ByteList runs{2, 1, 0, 3, 0, 1, 0, 0, 0, 0, 0, 2, 1, 0, 1, 1, 0, 1};
  EXPECT_THAT(samples_of(bmp_of({5, 2, 8, 1, {7, 7, 7, 0, 9, 9, 9, 0}, runs, 2})),
              ElementsAre(CV_8UC1, 7, 9, 7, 7, 7, 9, 9, 7, 9, 7));
}

TEST(BmpFile, RunsOfFourBitsAreUnpacked) {
  // Three of 1 0 1; five literal 1 0 0 1 1 (three bytes, padded); end of bitmap.
  const ByteList runs{3, 0x10, 0, 5, 0x10, 0x01, 0x10, 0, 0, 1};
  EXPECT_THAT(samples_of(bmp_of({8, 1, 4, 2, {7, 7, 7, 0, 9, 9, 9, 0}, runs, 2})),
              ElementsAre(CV_8UC1, 9, 7, 9, 9, 7, 7, 9, 9));
}

TEST(BmpFile, RunsThatLeaveThePictureOrHaveNoEndAreRefused) {
  const ByteList greys{7, 7, 7, 0, 9, 9, 9, 0};
  EXPECT_THAT(refusal(bmp_of({2, 1, 8, 1, greys, {3, 1, 0, 1}, 2})), HasSubstr("leaves"));
  EXPECT_THAT(refusal(bmp_of({2, 1, 8, 1, greys, {2, 1, 0, 0, 1, 1, 0, 1}, 2})), HasSubstr("leaves"));
  EXPECT_THAT(refusal(bmp_of({2, 1, 8, 1, greys, {0, 2, 0, 200, 1, 1, 0, 1}, 2})), HasSubstr("leaves"));
  EXPECT_THAT(refusal(bmp_of({2, 1, 8, 1, greys, {2, 1}, 2})), HasSubstr("truncated"));
  EXPECT_NE(refusal(bmp_of({2, -1, 8, 1, greys, {2, 1, 0, 1}, 2})), "accepted") << "runs go up";
  EXPECT_NE(refusal(bmp_of({2, 1, 4, 1, greys, {2, 1, 0, 1}, 2})), "accepted") << "RLE8 of 4 bits";
}

TEST(BmpFile, CutAnywhereItIsRefused) {
  for (const ByteList& whole :
       {bmp_of({3, 2, 24, 0, {}, ByteList(24, 5)}), bmp_of({3, 1, 8, 0, two_colors, {0, 1, 0, 0}, 2}),
        bmp_of({5, 2, 8, 1, two_colors, {5, 1, 0, 0, 5, 0, 0, 1}, 2})}) {
    EXPECT_EQ(refusal(whole), "accepted");
    EXPECT_EQ(refusal(whole + ByteList(50, 0xee)), "accepted") << "bytes after the end";
    for (std::size_t keep = 2; keep < whole.size(); ++keep)
      EXPECT_NE(refusal(cut(whole, keep)), "accepted") << keep;
  }
}

TEST(BmpFile, WhatMakesNoSenseIsRefused) {
  EXPECT_THAT(refusal(bmp_of({2, 1, 8, 0, two_colors, {0, 2, 0, 0}, 2})), HasSubstr("palette index 2"));
  EXPECT_NE(refusal(bmp_of({1, 1, 24, 0, {}, ByteList(4), 0, 41})), "accepted") << "header of 41 bytes";
  EXPECT_NE(refusal(bmp_of({1, 1, 7, 0, two_colors, ByteList(4)})), "accepted") << "7 bits";
  EXPECT_NE(refusal(bmp_of({1, 1, 24, 3, ByteList(12), ByteList(4)})), "accepted") << "masks of 24 bits";
  EXPECT_NE(refusal(bmp_of({1, 1, 8, 0, two_colors, ByteList(4), 300})), "accepted") << "300 colours";
  EXPECT_THAT(refusal(bmp_of({1, 1, 0, 5, {}, ByteList(4)})), HasSubstr("inside"));
  const ByteList gaps = little(0xf0f0, 4) + little(0, 4) + little(0x000f, 4);
  EXPECT_THAT(refusal(bmp_of({1, 1, 16, 3, gaps, ByteList(4)})), HasSubstr("gaps"));
}

TEST(BmpFile, TheSizeIsCheckedBeforeAnythingIsDecoded) {
  EXPECT_THAT(refusal(bmp_of({32000, 32000, 8, 1, two_colors, {0, 1}, 2})), HasSubstr("too large"));
  EXPECT_THAT(refusal(bmp_of({2147483647, 2147483647, 32, 0, {}, {}})), HasSubstr("too large"));
  EXPECT_THAT(refusal(bmp_of({1, -2147483647 - 1, 32, 0, {}, {}})), HasSubstr("too large"));
  EXPECT_NE(refusal(bmp_of({-1, 1, 24, 0, {}, ByteList(4)})), "accepted");
  EXPECT_NE(refusal(bmp_of({0, 1, 24, 0, {}, ByteList(4)})), "accepted");
  EXPECT_NE(refusal(bmp_of({1, 0, 24, 0, {}, ByteList(4)})), "accepted");
}

}  // namespace
}  // namespace eigenpose::test
