#include "core/image/picture_file.h"

#include <fstream>

#include <gmock/gmock.h>
#include <sys/stat.h>

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

TEST(PictureFile, APictureThatTheFormatDoesNotTakeIsAnErrorAndNoEmptyFile) {
  const auto refusal = [](const auto& encode) {
    try {
      encode();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("encoded");
  };
  const cv::Mat wide(1, 1'000'001, CV_8UC1, cv::Scalar(7));
  EXPECT_THAT(refusal([&] { (void)encode_png(wide); }), HasSubstr("1000001x1"));
  EXPECT_THAT(refusal([&] { (void)encode_jpeg(wide, 85); }), HasSubstr("1000001x1"));
  EXPECT_FALSE(encode_jpeg(cv::Mat(8, 8, CV_8UC3, cv::Scalar(1, 2, 3)), 85).empty());
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

TEST(PictureFile, RefusesEveryFormatThatIsNotPromised) {
  const std::vector<std::string> others = {"GIF89a\1\0\1\0",
                                           std::string("RIFF\x1a\0\0\0WEBPVP8L", 16),
                                           "\x76\x2f\x31\x01 EXR",
                                           "#?RADIANCE\n",
                                           std::string("\0\0\0\x0cjP  \r\n\x87\n", 12),
                                           "<svg xmlns='http://www.w3.org/2000/svg'/>",
                                           "\xff\x4f\xff\x51 J2K",
                                           std::string("\0\0\1\0", 4),
                                           "%PDF-1.4\n",
                                           "\x59\xa6\x6a\x95 sun"};
  for (const std::string& bytes : others)
    EXPECT_THAT(refusal({bytes.begin(), bytes.end()}),
                HasSubstr("not a picture that can be read; PNG, JPEG"));
}

TEST(PictureFile, KnowsAFileByItsContentAndNotByItsName) {
  const test::TemporaryFolder folder;
  const auto bytes = encode_png(picture_noise(3, 4, CV_8UC1));
  std::ofstream(folder.path() / "photo.jpg", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  EXPECT_EQ(load_picture(folder.path() / "photo.jpg").size(), cv::Size(4, 3));
}

TEST(PictureFile, RefusesPipesAndDevicesAtOnce) {
  const test::TemporaryFolder folder;
  const auto pipe = folder.path() / "pipe.png";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::filesystem::path& file : {pipe, std::filesystem::path("/dev/null")}) {
    try {
      load_picture(file);
      ADD_FAILURE() << "accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr("; give a plain file"));
    }
  }
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
