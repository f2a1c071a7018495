#include "core/image/picture_file.h"

#include <fstream>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;

cv::Mat picture_noise(int rows, int cols, int type) {
  cv::Mat image(rows, cols, type);
  cv::RNG(7).fill(image, cv::RNG::UNIFORM, 0, type == CV_16UC1 ? 65536 : 256);
  return image;
}

std::string refusal(const std::vector<unsigned char>& bytes) {
  try {
    decode_picture(bytes, "view.png");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(PictureFile, GivesBackEveryPixelOfEveryKind) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1}) {
    const cv::Mat image = picture_noise(31, 47, type);
    const cv::Mat back = decode_picture(encode_png(image), "view.png");
    ASSERT_EQ(back.type(), type);
    EXPECT_EQ(cv::norm(image, back, cv::NORM_INF), 0.0);
  }
}

TEST(PictureFile, RefusesAPngCutAnywhere) {
  const auto bytes = encode_png(picture_noise(40, 40, CV_8UC1));
  for (std::size_t keep = 1; keep < bytes.size(); keep += 13)
    EXPECT_NE(refusal({bytes.begin(), bytes.begin() + static_cast<long>(keep)}), "accepted") << keep;
  EXPECT_THAT(refusal({bytes.begin(), bytes.end() - 1}), HasSubstr("truncated"));
}

TEST(PictureFile, RefusesAPngWithOneFlippedByteAnywhere) {
  const auto bytes = encode_png(picture_noise(40, 40, CV_8UC1));
  for (std::size_t at = 0; at < bytes.size(); at += 7) {
    auto damaged = bytes;
    damaged[at] ^= 0xff;
    EXPECT_NE(refusal(damaged), "accepted") << at;
  }
}

TEST(PictureFile, RefusesTruncatedJpegAndPgm) {
  const std::string pgm = "P5\n# made by hand\n4 3\n255\n0123456789a";  // one byte short
  EXPECT_THAT(refusal({pgm.begin(), pgm.end()}), HasSubstr("11 of 12 bytes"));
  const std::string whole = pgm + "b";
  EXPECT_EQ(refusal({whole.begin(), whole.end()}), "accepted");
  EXPECT_THAT(refusal({0xff, 0xd8, 0xff, 0xe0, 0, 16}), HasSubstr("JPEG"));
}

TEST(PictureFile, SaysWhatIsWrongWithAFile) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal({}), HasSubstr("is empty"));
  EXPECT_THAT(refusal({'h', 'e', 'l', 'l', 'o'}), HasSubstr("not a picture"));
  EXPECT_THROW(load_picture(folder.path() / "absent.png"), FileError);
  EXPECT_THROW(load_picture(folder.path()), FileError);
}

}  // namespace
}  // namespace eigenpose
