// TIFF 6.0: byte orders, depths, photometric interpretations, extra samples, strips, tiles and compression.

#include <map>

#include <gmock/gmock.h>

#include "tests/support/jpeg_bytes.h"

namespace eigenpose::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int none = 1, lzw = 5, deflate = 8, pack_bits = 32773;
constexpr int white_is_zero = 0, black_is_zero = 1, rgb = 2, palette = 3, cmyk = 5;

/// The directory of a picture in one strip, which a test changes tag by tag.
std::map<int, TiffEntry> one_strip(std::uint32_t width, std::uint32_t height, std::uint32_t bits, int colors,
                                   std::size_t bytes) {
  const std::uint32_t samples = colors == rgb ? 3 : (colors == cmyk ? 4 : 1);
  std::map<int, TiffEntry> entries;
  const auto set = [&](int tag, std::vector<std::uint32_t> values, int type = 3) {
    entries[tag] = {tag, std::move(values), type};
  };
  set(256, {width}, 4);
  set(257, {height}, 4);
  set(258, std::vector<std::uint32_t>(samples, bits));
  set(259, {none});
  set(262, {static_cast<std::uint32_t>(colors)});
  set(273, {8}, 4);
  set(277, {samples});
  set(278, {height}, 4);
  set(279, {static_cast<std::uint32_t>(bytes)}, 4);
  return entries;
}

ByteList file_of(const std::map<int, TiffEntry>& entries, const ByteList& data, bool big_endian = false) {
  std::vector<TiffEntry> list;
  for (const auto& [tag, entry] : entries) list.push_back(entry);
  return tiff_of(list, data, big_endian);
}

ByteList simple(std::uint32_t width, std::uint32_t height, std::uint32_t bits, int colors,
                const ByteList& data, bool big_endian = false) {
  return file_of(one_strip(width, height, bits, colors, data.size()), data, big_endian);
}

void set(std::map<int, TiffEntry>& entries, int tag, std::vector<std::uint32_t> values, int type = 3) {
  entries[tag] = {tag, std::move(values), type};
}

TEST(TiffFile, GreyOfEveryDepthIsScaledToTheFullRange) {
  EXPECT_THAT(samples_of(simple(3, 2, 1, black_is_zero, {0b10100000, 0b01000000})),
              ElementsAre(CV_8UC1, 255, 0, 255, 0, 255, 0));
  EXPECT_THAT(samples_of(simple(4, 1, 2, black_is_zero, {0b00011011})),
              ElementsAre(CV_8UC1, 0, 85, 170, 255));
  EXPECT_THAT(samples_of(simple(3, 1, 4, black_is_zero, {0x08, 0xf0})), ElementsAre(CV_8UC1, 0, 136, 255));
  EXPECT_THAT(samples_of(simple(2, 1, 8, black_is_zero, {7, 255})), ElementsAre(CV_8UC1, 7, 255));
}

TEST(TiffFile, SixteenBitsFollowTheByteOrderOfTheFile) {
  EXPECT_THAT(samples_of(simple(2, 1, 16, black_is_zero, {0x12, 0x34, 0xff, 0xfe}, true)),
              ElementsAre(CV_16UC1, 0x1234, 0xfffe));
  EXPECT_THAT(samples_of(simple(2, 1, 16, black_is_zero, {0x34, 0x12, 0xfe, 0xff}, false)),
              ElementsAre(CV_16UC1, 0x1234, 0xfffe));
  EXPECT_THAT(samples_of(simple(1, 1, 16, rgb, {0xff, 0xff, 0x80, 0x80, 0, 0x81}, true)),
              ElementsAre(CV_8UC3, 255, 128, 1));
}

TEST(TiffFile, WhiteIsZeroIsTurnedRound) {
  EXPECT_THAT(samples_of(simple(3, 1, 1, white_is_zero, {0b10100000})), ElementsAre(CV_8UC1, 0, 255, 0));
  EXPECT_THAT(samples_of(simple(2, 1, 8, white_is_zero, {7, 255})), ElementsAre(CV_8UC1, 248, 0));
  EXPECT_THAT(samples_of(simple(1, 1, 16, white_is_zero, {0x00, 0x01}, true)), ElementsAre(CV_16UC1, 65534));
}

TEST(TiffFile, APaletteGivesItsColours) {
  auto entries = one_strip(2, 1, 1, palette, 1);
  set(entries, 320, {10 * 257, 40 * 257, 20 * 257, 50 * 257, 30 * 257, 60 * 257});
  EXPECT_THAT(samples_of(file_of(entries, {0b01000000})), ElementsAre(CV_8UC3, 10, 20, 30, 40, 50, 60));
  set(entries, 320, {10, 40, 20, 50, 30, 60});
  EXPECT_THAT(samples_of(file_of(entries, {0b01000000})), ElementsAre(CV_8UC3, 10, 20, 30, 40, 50, 60))
      << "old writers give 8 bits";
  entries.erase(320);
  EXPECT_THAT(refusal(file_of(entries, {0b01000000})), HasSubstr("colour map"));
}

TEST(TiffFile, InksBecomeColours) {
  EXPECT_THAT(samples_of(simple(2, 1, 8, cmyk, {0, 255, 0, 0, 0, 0, 0, 155})),
              ElementsAre(CV_8UC3, 255, 0, 255, 100, 100, 100));
}

TEST(TiffFile, WhatIsTransparentIsBlack) {
  const ByteList data{255, 255, 255, 0, 100, 200, 50, 51};
  auto entries = one_strip(2, 1, 8, rgb, data.size());
  set(entries, 258, {8, 8, 8, 8});
  set(entries, 277, {4});
  set(entries, 338, {2});
  EXPECT_THAT(samples_of(file_of(entries, data)), ElementsAre(CV_8UC3, 0, 0, 0, 20, 40, 10))
      << "unassociated";
  set(entries, 338, {1});
  EXPECT_THAT(samples_of(file_of(entries, {0, 0, 0, 0, 20, 40, 10, 51})),
              ElementsAre(CV_8UC3, 0, 0, 0, 20, 40, 10))
      << "associated: multiplied by the writer";
  set(entries, 338, {0});
  EXPECT_THAT(samples_of(file_of(entries, data)), ElementsAre(CV_8UC3, 255, 255, 255, 100, 200, 50))
      << "no opacity at all";
  auto grey = one_strip(2, 1, 16, black_is_zero, 8);
  set(grey, 258, {16, 16});
  set(grey, 277, {2});
  set(grey, 338, {2});
  EXPECT_THAT(samples_of(file_of(grey, {255, 255, 0, 0, 255, 255, 0x80, 0}, true)),
              ElementsAre(CV_16UC1, 0, 0x8000))
      << "16-bit grey";
}

TEST(TiffFile, OrientationIsApplied) {
  for (std::uint32_t orientation = 0; orientation <= 9; ++orientation) {
    auto entries = one_strip(3, 2, 8, black_is_zero, 6);
    set(entries, 274, {orientation});
    const cv::Mat picture = decode_picture(file_of(entries, {1, 2, 3, 4, 5, 6}), "view");
    const cv::Mat wanted = as_seen(static_cast<int>(orientation));
    ASSERT_EQ(picture.size(), wanted.size()) << orientation;
    EXPECT_EQ(cv::norm(picture, wanted, cv::NORM_INF), 0.0) << orientation;
  }
}

TEST(TiffFile, StripsTilesAndPlanesAreJoined) {
  auto strips = one_strip(2, 3, 8, black_is_zero, 6);
  set(strips, 278, {2}, 4);
  set(strips, 273, {10, 8}, 4);  // the last strip lies first
  set(strips, 279, {4, 2}, 4);
  EXPECT_THAT(samples_of(file_of(strips, {5, 6, 1, 2, 3, 4})), ElementsAre(CV_8UC1, 1, 2, 3, 4, 5, 6));

  auto tiles = one_strip(3, 2, 8, black_is_zero, 8);
  for (const int tag : {273, 278, 279}) tiles.erase(tag);
  set(tiles, 322, {2});
  set(tiles, 323, {2});
  set(tiles, 324, {8, 12}, 4);
  set(tiles, 325, {4, 4}, 4);
  EXPECT_THAT(samples_of(file_of(tiles, {1, 2, 4, 5, 3, 99, 6, 99})), ElementsAre(CV_8UC1, 1, 2, 3, 4, 5, 6));

  auto planes = one_strip(2, 1, 8, rgb, 6);
  set(planes, 284, {2});
  set(planes, 273, {8, 10, 12}, 4);
  set(planes, 279, {2, 2, 2}, 4);
  EXPECT_THAT(samples_of(file_of(planes, {1, 2, 3, 4, 5, 6})), ElementsAre(CV_8UC3, 1, 3, 5, 2, 4, 6));
}

TEST(TiffFile, BitsMayBeFilledFromTheLowEnd) {
  auto entries = one_strip(3, 1, 1, black_is_zero, 1);
  set(entries, 266, {2});
  EXPECT_THAT(samples_of(file_of(entries, {0b00000011})), ElementsAre(CV_8UC1, 255, 255, 0));
}

TEST(TiffFile, PackBitsIsUnpacked) {
  const ByteList packed{0x80, 1,  10, 20,
                        0xfe, 30, 0,  40};  // nothing, two literal, three times 30, one literal
  auto entries = one_strip(6, 1, 8, black_is_zero, packed.size());
  set(entries, 259, {pack_bits});
  EXPECT_THAT(samples_of(file_of(entries, packed)), ElementsAre(CV_8UC1, 10, 20, 30, 30, 30, 40));
}

/// TIFF 6.0, section 13, for short rows: a clear code before every byte keeps all codes at 9 bits.
ByteList lzw_of(const std::vector<std::uint32_t>& codes) {
  ByteList bytes;
  std::uint32_t buffer = 0, bits = 0;
  for (const std::uint32_t code : codes) {
    buffer = buffer << 9U | code;
    for (bits += 9; bits >= 8; bits -= 8) bytes.push_back(static_cast<unsigned char>(buffer >> (bits - 8)));
  }
  if (bits > 0) bytes.push_back(static_cast<unsigned char>(buffer << (8 - bits)));
  return bytes;
}

TEST(TiffFile, LzwIsUnpacked) {
  // The example of the specification: 7 7 7 8 8 7 7 6 6.
  const ByteList packed = lzw_of({256, 7, 258, 8, 8, 258, 6, 6, 257});
  auto entries = one_strip(9, 1, 8, black_is_zero, packed.size());
  set(entries, 259, {lzw});
  EXPECT_THAT(samples_of(file_of(entries, packed)), ElementsAre(CV_8UC1, 7, 7, 7, 8, 8, 7, 7, 6, 6));
  EXPECT_NE(refusal(file_of(entries, lzw_of({256, 7, 300, 8, 8, 258, 6, 6, 257}))), "accepted")
      << "undefined code";
  EXPECT_THAT(refusal(file_of(entries, lzw_of({256, 7, 258, 8, 8, 257, 0, 0, 0}))), HasSubstr("truncated"));
}

TEST(TiffFile, LzwCodesGrowToTwelveBitsAndBeginAnew) {
  // Literals alone: after each the table grows, so the width follows from how many there were.
  std::vector<int> wanted{CV_8UC1};
  ByteList packed;
  std::uint64_t buffer = 0;
  std::uint32_t bits = 0, width = 9, used = 258;
  const auto put = [&](std::uint32_t code) {
    buffer = buffer << width | code;
    for (bits += width; bits >= 8; bits -= 8)
      packed.push_back(static_cast<unsigned char>(buffer >> (bits - 8)));
  };
  put(256);
  constexpr std::uint32_t pixels = 9000;
  for (std::uint32_t i = 0; i < pixels; ++i) {
    const std::uint32_t value = i * 37 % 251;
    put(value);
    wanted.push_back(static_cast<int>(value));
    if (++used == 4095) {  // "as soon as we use entry 4094, we write out a (12-bit) ClearCode"
      put(256);
      width = 9;
      used = 258;
      continue;
    }
    // The writer has defined entry used − 1: "as soon as we add table entry 511, we switch to 10-bit codes".
    if (used == 512 || used == 1024 || used == 2048) ++width;
  }
  put(257);
  if (bits > 0) packed.push_back(static_cast<unsigned char>(buffer << (8 - bits)));
  auto entries = one_strip(pixels, 1, 8, black_is_zero, packed.size());
  set(entries, 259, {lzw});
  EXPECT_EQ(samples_of(file_of(entries, packed)), wanted);
}

TEST(TiffFile, DeflateIsUnpackedUnderBothItsNumbers) {
  const ByteList packed = deflated({1, 2, 3, 4, 5, 6});
  auto entries = one_strip(3, 2, 8, black_is_zero, packed.size());
  for (const std::uint32_t compression : {std::uint32_t{deflate}, 32946U}) {
    set(entries, 259, {compression}, 4);
    EXPECT_THAT(samples_of(file_of(entries, packed)), ElementsAre(CV_8UC1, 1, 2, 3, 4, 5, 6));
  }
  ByteList damaged = packed;
  damaged[2] ^= 0xff;
  EXPECT_NE(refusal(file_of(entries, damaged)), "accepted");
}

TEST(TiffFile, StripsAndTilesOfJpegAreRead) {
  cv::Mat left(16, 16, CV_8UC3, cv::Scalar(200, 100, 50));
  cv::Mat right(16, 16, CV_8UC3, cv::Scalar(30, 60, 90));
  const ByteList first = jpeg_of(left), second = jpeg_of(right);
  auto tiles = one_strip(24, 16, 8, 6, 0);
  for (const int tag : {273, 278, 279}) tiles.erase(tag);
  set(tiles, 258, {8, 8, 8});
  set(tiles, 259, {7});
  set(tiles, 277, {3});
  set(tiles, 322, {16});
  set(tiles, 323, {16});
  set(tiles, 324, {8, static_cast<std::uint32_t>(8 + first.size())}, 4);
  set(tiles, 325, {static_cast<std::uint32_t>(first.size()), static_cast<std::uint32_t>(second.size())}, 4);
  cv::Mat wanted;
  cv::hconcat(left, right.colRange(0, 8), wanted);
  const cv::Mat picture = decode_picture(file_of(tiles, first + second), "view");
  ASSERT_EQ(picture.size(), wanted.size());
  EXPECT_LE(cv::norm(picture, wanted, cv::NORM_INF), 3.0);
  const ByteList half = cut(second, second.size() / 2 + 100);
  set(tiles, 325, {static_cast<std::uint32_t>(first.size()), static_cast<std::uint32_t>(half.size())}, 4);
  EXPECT_NE(refusal(file_of(tiles, first + half)), "accepted");

  // The tables in a tag of their own, as libtiff writes them.
  const ByteList grey = jpeg_of(cv::Mat(16, 16, CV_8UC1, cv::Scalar(77)), {.colors = JCS_GRAYSCALE});
  ByteList tables = cut(grey, 2), rest = tables;
  std::size_t at = 2;
  while (grey[at + 1] != 0xda) {
    const std::size_t length = 2U + grey[at + 2] * 256U + grey[at + 3];
    const ByteList segment(grey.begin() + static_cast<std::ptrdiff_t>(at),
                           grey.begin() + static_cast<std::ptrdiff_t>(at + length));
    ByteList& to = grey[at + 1] == 0xdb || grey[at + 1] == 0xc4 ? tables : rest;
    to = to + segment;
    at += length;
  }
  rest = rest + ByteList(grey.begin() + static_cast<std::ptrdiff_t>(at), grey.end());
  tables = tables + end_mark;
  auto strip = one_strip(16, 16, 8, black_is_zero, rest.size());
  set(strip, 259, {7});
  set(strip, 347, {tables.begin(), tables.end()}, 7);
  EXPECT_LE(cv::norm(decode_picture(file_of(strip, rest), "view"), cv::Mat(16, 16, CV_8UC1, cv::Scalar(77)),
                     cv::NORM_INF),
            1.0);
  set(strip, 262, {2});
  set(strip, 258, {8, 8, 8});
  set(strip, 277, {3});
  EXPECT_THAT(refusal(file_of(strip, rest)), HasSubstr("compression 7 and colour space 2"));
}

TEST(TiffFile, DifferencesAreAddedUp) {
  auto entries = one_strip(3, 1, 8, rgb, 9);
  set(entries, 317, {2});
  EXPECT_THAT(samples_of(file_of(entries, {10, 20, 30, 1, 2, 3, 255, 0, 1})),
              ElementsAre(CV_8UC3, 10, 20, 30, 11, 22, 33, 10, 22, 34));
  auto wide = one_strip(2, 1, 16, black_is_zero, 4);
  set(wide, 317, {2});
  EXPECT_THAT(samples_of(file_of(wide, {0xff, 0xff, 0x00, 0x02}, true)), ElementsAre(CV_16UC1, 65535, 1));
}

TEST(TiffFile, DifferencesAreAddedUpInEachPlane) {
  auto entries = one_strip(3, 1, 8, rgb, 9);
  set(entries, 317, {2});
  set(entries, 284, {2});
  set(entries, 273, {8, 11, 14}, 4);
  set(entries, 279, {3, 3, 3}, 4);
  EXPECT_THAT(samples_of(file_of(entries, {10, 1, 255, 20, 2, 0, 30, 3, 1})),
              ElementsAre(CV_8UC3, 10, 20, 30, 11, 22, 33, 10, 22, 34));
}

TEST(TiffFile, DataThatEndsEarlyIsTruncated) {
  const ByteList data{1, 2, 3, 4, 5, 6};
  EXPECT_THAT(refusal(file_of(one_strip(3, 2, 8, black_is_zero, 5), data)), HasSubstr("5 of 6 bytes"));
  auto outside = one_strip(3, 2, 8, black_is_zero, 6);
  set(outside, 273, {100'000}, 4);
  EXPECT_THAT(refusal(file_of(outside, data)), HasSubstr("truncated"));
  auto missing = one_strip(3, 2, 8, black_is_zero, 6);
  set(missing, 278, {1}, 4);
  EXPECT_THAT(refusal(file_of(missing, data)), HasSubstr("1 of 2 strips"));
  const ByteList whole = simple(3, 2, 8, black_is_zero, data);
  for (std::size_t keep = 4; keep + 4 < whole.size(); ++keep)  // the last four say that no directory follows
    EXPECT_NE(refusal(cut(whole, keep)), "accepted") << keep;
  EXPECT_EQ(refusal(whole + ByteList(100, 0xee)), "accepted") << "bytes after the end";
}

TEST(TiffFile, KindsThatAreNotReadAreNamed) {
  const auto changed = [](int tag, std::vector<std::uint32_t> values) {
    auto entries = one_strip(1, 1, 8, black_is_zero, 4);
    set(entries, tag, std::move(values));
    return refusal(file_of(entries, ByteList(4)));
  };
  EXPECT_THAT(changed(258, {32}), HasSubstr("32 bits"));
  EXPECT_THAT(changed(259, {4}), HasSubstr("compression 4"));
  EXPECT_THAT(changed(262, {8}), HasSubstr("colour space 8"));
  EXPECT_THAT(changed(339, {3}), HasSubstr("floating-point"));
  EXPECT_THAT(changed(317, {3}), HasSubstr("predictor 3"));
  EXPECT_THAT(changed(277, {0}), HasSubstr("0 samples"));
  EXPECT_THAT(refusal(bytes_of("II+") + ByteList(13)), HasSubstr("BigTIFF"));
}

TEST(TiffFile, TheSizeIsCheckedBeforeAnythingIsDecoded) {
  EXPECT_THAT(refusal(simple(32'000, 32'000, 8, black_is_zero, {1})), HasSubstr("too large"));
  EXPECT_THAT(refusal(simple(0xffffffff, 0xffffffff, 8, black_is_zero, {1})), HasSubstr("too large"));
  EXPECT_NE(refusal(simple(0, 1, 8, black_is_zero, {1})), "accepted");
  EXPECT_NE(refusal(simple(1, 0, 8, black_is_zero, {1})), "accepted");
  auto tiles = one_strip(1, 1, 8, black_is_zero, 1);
  set(tiles, 322, {0xffff'ffff}, 4);
  set(tiles, 323, {0xffff'ffff}, 4);
  set(tiles, 324, {8}, 4);
  set(tiles, 325, {1}, 4);
  EXPECT_THAT(refusal(file_of(tiles, {1})), HasSubstr("too large"));
  set(tiles, 322, {0}, 4);
  EXPECT_NE(refusal(file_of(tiles, {1})), "accepted");
  auto samples = one_strip(1, 1, 8, black_is_zero, 1);
  set(samples, 277, {65535});
  EXPECT_NE(refusal(file_of(samples, {1})), "accepted");
}

}  // namespace
}  // namespace eigenpose::test
