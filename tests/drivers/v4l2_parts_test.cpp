// The parts of the V4L2 driver: modes, control names, pixels, memory, and nodes in a made-up /sys.
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <linux/videodev2.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "drivers/v4l2/camera_controls.h"
#include "drivers/v4l2/capture_mode.h"
#include "drivers/v4l2/frame_pool.h"
#include "drivers/v4l2/pixel_format.h"

namespace eigenpose::test {
namespace {

CaptureMode mode(PixelFormat format, int width, int height, double rate) {
  return {fourcc_of(format), format, width, height, rate};
}

std::string best_of(const std::vector<CaptureMode>& modes, const ModeWishes& wishes) {
  const auto best = best_mode(modes, wishes);
  return best ? to_string(*best) : "none";
}

TEST(CaptureMode, TakesTheSizeThatWasAskedBeforeAnyOther) {
  EXPECT_EQ(best_of({mode(PixelFormat::yuyv, 1280, 720, 30), mode(PixelFormat::yuyv, 640, 480, 30),
                     mode(PixelFormat::yuyv, 320, 240, 30)},
                    {}),
            "YUYV 640x480 at 30 fps");
}

TEST(CaptureMode, TakesMorePixelsRatherThanFewer) {
  ModeWishes wishes;
  wishes.width = 600;
  wishes.height = 450;
  EXPECT_EQ(best_of({mode(PixelFormat::yuyv, 560, 420, 30), mode(PixelFormat::yuyv, 640, 480, 30)}, wishes),
            "YUYV 640x480 at 30 fps");
}

TEST(CaptureMode, PrefersUncompressedFramesAtTheSameSizeAndRate) {
  EXPECT_EQ(best_of({mode(PixelFormat::mjpeg, 640, 480, 30), mode(PixelFormat::yuyv, 640, 480, 30)}, {}),
            "YUYV 640x480 at 30 fps");
}

TEST(CaptureMode, TakesMjpegWhenItAloneBringsTheRate) {
  EXPECT_EQ(best_of({mode(PixelFormat::yuyv, 1280, 720, 10), mode(PixelFormat::mjpeg, 1280, 720, 30)},
                    {1280, 720, 30.0, true, {}}),
            "MJPG 1280x720 at 30 fps");
}

TEST(CaptureMode, NeverTakesGreyForColourNorAFormatThatIsNotListed) {
  EXPECT_EQ(best_of({mode(PixelFormat::grey, 640, 480, 30)}, {}), "none");
  EXPECT_EQ(best_of({mode(PixelFormat::grey, 640, 480, 30), mode(PixelFormat::nv12, 640, 480, 30)},
                    {640, 480, 30.0, false, {}}),
            "GREY 640x480 at 30 fps");
  EXPECT_EQ(best_of({mode(PixelFormat::yuyv, 640, 480, 30)}, {640, 480, 30.0, true, {PixelFormat::nv12}}),
            "none");
}

TEST(ControlName, IsWhatV4l2CtlShows) {
  EXPECT_EQ(control_name("Exposure Time, Absolute"), "exposure_time_absolute");
  EXPECT_EQ(control_name("White Balance Temperature"), "white_balance_temperature");
  EXPECT_EQ(control_name("  50 Hz (test) "), "50_hz_test");
}

std::vector<std::uint8_t> random_bytes(std::size_t count) {
  std::mt19937 random(1);
  std::vector<std::uint8_t> bytes(count);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

TEST(Luma, OfYuyvIsEverySecondByteAtEveryWidth) {
  const auto bytes = random_bytes(200);
  for (std::size_t pixels = 0; pixels <= 100; ++pixels) {
    std::vector<std::uint8_t> luma(pixels + 1, 77);
    luma_of_yuyv(bytes.data(), luma.data(), pixels, LumaRange::full);
    for (std::size_t i = 0; i < pixels; ++i) ASSERT_EQ(luma[i], bytes[2 * i]);
    ASSERT_EQ(luma[pixels], 77) << "written past the end";
  }
}

TEST(Luma, LimitedRangeIsSpreadToTheNearestByte) {
  std::vector<std::uint8_t> all(256);
  for (int i = 0; i < 256; ++i) all[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(i);
  // 256 for the SIMD path, 15 at a time for the scalar one: both must agree with the definition.
  for (const std::size_t chunk : {std::size_t{256}, std::size_t{15}}) {
    std::vector<std::uint8_t> luma(256);
    for (std::size_t from = 0; from < 256; from += chunk) {
      copy_luma(all.data() + from, luma.data() + from, std::min(chunk, 256 - from), LumaRange::limited);
    }
    for (int i = 0; i < 256; ++i) {
      const double exact = std::clamp((i - 16) * 255.0 / 219.0, 0.0, 255.0);
      // Half a step for rounding, and 0.07 for the factor 596/512 at the bright end.
      EXPECT_NEAR(luma[static_cast<std::size_t>(i)], exact, 0.57) << i << " chunk " << chunk;
    }
    EXPECT_EQ(luma[16], 0);
    EXPECT_EQ(luma[235], 255);
  }
}

/// BT.601 in floating point.
cv::Vec3d exact_bgr(double y, double u, double v, LumaRange range) {
  const bool limited = range == LumaRange::limited;
  const double luma = limited ? 255.0 / 219.0 * (y - 16.0) : y;
  const double chroma_scale = limited ? 255.0 / 224.0 : 1.0;
  const double blue = (u - 128.0) * chroma_scale;
  const double red = (v - 128.0) * chroma_scale;
  return {luma + 1.772 * blue, luma - 0.344136 * blue - 0.714136 * red, luma + 1.402 * red};
}

/// The same random picture in both formats, and what it should become.
struct ColorBuffers {
  static constexpr int width = 34, height = 8, padding = 6;
  static constexpr std::size_t stride = 2 * width + padding, nv12_stride = width + padding;

  explicit ColorBuffers(LumaRange range)
      : yuyv(stride * height), nv12(nv12_stride * height * 3 / 2), exact(height, width) {
    std::mt19937 random(2);
    const bool limited = range == LumaRange::limited;
    std::uniform_int_distribution<int> luma_of(limited ? 16 : 0, limited ? 235 : 255), chroma_of(64, 192);
    for (int row = 0; row < height; row += 2)
      for (int column = 0; column < width; column += 2) {
        const int u = chroma_of(random), v = chroma_of(random);
        std::uint8_t* chroma =
            nv12.data() + nv12_stride * static_cast<std::size_t>(height + row / 2) + column;
        chroma[0] = static_cast<std::uint8_t>(u);
        chroma[1] = static_cast<std::uint8_t>(v);
        for (int pixel = 0; pixel < 4; ++pixel) {
          const int y = luma_of(random), dy = pixel / 2, dx = pixel % 2;
          nv12[nv12_stride * static_cast<std::size_t>(row + dy) + static_cast<std::size_t>(column + dx)] =
              static_cast<std::uint8_t>(y);
          std::uint8_t* pair = yuyv.data() + stride * static_cast<std::size_t>(row + dy) + 2 * column;
          pair[2 * dx] = static_cast<std::uint8_t>(y);
          pair[1] = static_cast<std::uint8_t>(u);
          pair[3] = static_cast<std::uint8_t>(v);
          exact(row + dy, column + dx) = exact_bgr(y, u, v, range);
        }
      }
  }

  std::vector<std::uint8_t> yuyv, nv12;
  cv::Mat_<cv::Vec3d> exact;
};

TEST(PixelDecoder, MakesYuyvAndNv12OfEitherRangeIntoTheSameBgr) {
  for (const LumaRange range : {LumaRange::limited, LumaRange::full}) {
    const ColorBuffers buffers(range);
    for (const PixelFormat format : {PixelFormat::yuyv, PixelFormat::nv12}) {
      const bool packed = format == PixelFormat::yuyv;
      PixelDecoder decoder({format, ColorBuffers::width, ColorBuffers::height,
                            packed ? ColorBuffers::stride : ColorBuffers::nv12_stride, range},
                           PictureKind::color);
      cv::Mat picture(ColorBuffers::height, ColorBuffers::width, CV_8UC3);
      ASSERT_EQ(decoder.decode(packed ? buffers.yuyv : buffers.nv12, picture), FrameFault::none);
      for (int row = 0; row < picture.rows; ++row)
        for (int column = 0; column < picture.cols; ++column)
          for (int channel = 0; channel < 3; ++channel) {
            const double expected = std::clamp(buffers.exact(row, column)[channel], 0.0, 255.0);
            // One for rounding, one for coefficients of three digits.
            ASSERT_NEAR(picture.at<cv::Vec3b>(row, column)[channel], expected, 2.0) << name_of(format);
          }
    }
  }
}

TEST(PixelDecoder, WritesColorOfFullRangeIntoThePictureItIsGiven) {
  const ColorBuffers buffers(LumaRange::full);
  PixelDecoder decoder(
      {PixelFormat::yuyv, ColorBuffers::width, ColorBuffers::height, ColorBuffers::stride, LumaRange::full},
      PictureKind::color);
  cv::Mat picture(ColorBuffers::height, ColorBuffers::width, CV_8UC3);
  const std::uint8_t* memory = picture.data;
  ASSERT_EQ(decoder.decode(buffers.yuyv, picture), FrameFault::none);
  EXPECT_EQ(picture.data, memory) << "the pool's memory, not new one";
}

TEST(PixelDecoder, ReadsLumaOfEveryFormatTheSame) {
  constexpr int width = 36, height = 4;
  const auto luma = random_bytes(width * height);
  std::vector<std::uint8_t> yuyv(2 * luma.size(), 99), nv12(luma.size() * 3 / 2, 99);
  for (std::size_t i = 0; i < luma.size(); ++i) yuyv[2 * i] = nv12[i] = luma[i];
  const cv::Mat expected(height, width, CV_8UC1, const_cast<std::uint8_t*>(luma.data()));
  const auto decoded = [&](PixelFormat format, std::size_t stride, const std::vector<std::uint8_t>& bytes) {
    cv::Mat picture(height, width, CV_8UC1);
    EXPECT_EQ(PixelDecoder({format, width, height, stride, LumaRange::full}, PictureKind::grey)
                  .decode(bytes, picture),
              FrameFault::none);
    return picture;
  };
  EXPECT_EQ(cv::norm(decoded(PixelFormat::grey, width, luma), expected, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(decoded(PixelFormat::yuyv, 2 * width, yuyv), expected, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(decoded(PixelFormat::nv12, width, nv12), expected, cv::NORM_INF), 0.0);
}

TEST(PixelDecoder, RefusesABufferThatIsTooShort) {
  PixelDecoder decoder({PixelFormat::yuyv, 16, 4, 32, LumaRange::limited}, PictureKind::color);
  cv::Mat picture(4, 16, CV_8UC3);
  EXPECT_EQ(decoder.decode(std::vector<std::uint8_t>(32 * 4 - 1), picture), FrameFault::too_short);
  EXPECT_EQ(decoder.decode(std::vector<std::uint8_t>(32 * 4), picture), FrameFault::none);
}

cv::Mat gradient() {
  cv::Mat picture(48, 64, CV_8UC3);
  for (int row = 0; row < picture.rows; ++row) {
    for (int column = 0; column < picture.cols; ++column) {
      picture.at<cv::Vec3b>(row, column) = {static_cast<std::uint8_t>(4 * column),
                                            static_cast<std::uint8_t>(5 * row), 90};
    }
  }
  return picture;
}

std::vector<std::uint8_t> encoded(const cv::Mat& picture) {
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", picture, jpeg, {cv::IMWRITE_JPEG_QUALITY, 95});
  return jpeg;
}

/// Without its Huffman tables, as many cameras send it.
std::vector<std::uint8_t> without_tables(const std::vector<std::uint8_t>& jpeg) {
  std::vector<std::uint8_t> stripped{jpeg[0], jpeg[1]};
  for (std::size_t at = 2; at + 4 < jpeg.size();) {
    const std::size_t length = 2 + static_cast<std::size_t>(jpeg[at + 2]) * 256 + jpeg[at + 3];
    if (jpeg[at + 1] == 0xda) {
      stripped.insert(stripped.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at), jpeg.end());
      break;
    }
    if (jpeg[at + 1] != 0xc4) {
      stripped.insert(stripped.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                      jpeg.begin() + static_cast<std::ptrdiff_t>(at + length));
    }
    at += length;
  }
  return stripped;
}

TEST(MjpegDecoding, GivesThePictureInColourAndInGrey) {
  const cv::Mat picture = gradient();
  const auto jpeg = encoded(picture);
  cv::Mat color(48, 64, CV_8UC3), grey(48, 64, CV_8UC1), expected_grey;
  cv::cvtColor(picture, expected_grey, cv::COLOR_BGR2GRAY);
  ASSERT_EQ(
      PixelDecoder({PixelFormat::mjpeg, 64, 48, 0, LumaRange::full}, PictureKind::color).decode(jpeg, color),
      FrameFault::none);
  ASSERT_EQ(
      PixelDecoder({PixelFormat::mjpeg, 64, 48, 0, LumaRange::full}, PictureKind::grey).decode(jpeg, grey),
      FrameFault::none);
  // What quality 95 loses on a smooth gradient, on average.
  EXPECT_LT(cv::norm(color, picture, cv::NORM_L1) / (64 * 48 * 3), 2.0);
  EXPECT_LT(cv::norm(grey, expected_grey, cv::NORM_L1) / (64 * 48), 2.0);
}

TEST(MjpegDecoding, UsesTheStandardTablesWhereTheCameraSendsNone) {
  const auto jpeg = encoded(gradient());
  const auto stripped = without_tables(jpeg);
  ASSERT_LT(stripped.size(), jpeg.size() - 300);
  PixelDecoder decoder({PixelFormat::mjpeg, 64, 48, 0, LumaRange::full}, PictureKind::color);
  cv::Mat whole(48, 64, CV_8UC3), bare(48, 64, CV_8UC3);
  ASSERT_EQ(decoder.decode(stripped, bare), FrameFault::none);
  ASSERT_EQ(decoder.decode(jpeg, whole), FrameFault::none);
  EXPECT_EQ(cv::norm(whole, bare, cv::NORM_INF), 0.0);
}

TEST(MjpegDecoding, SurvivesEveryKindOfDamageAndDecodesTheNextFrame) {
  const auto jpeg = encoded(gradient());
  PixelDecoder decoder({PixelFormat::mjpeg, 64, 48, 0, LumaRange::full}, PictureKind::color);
  cv::Mat picture(48, 64, CV_8UC3);
  for (std::size_t length = 0; length + 2 < jpeg.size(); length += 7) {
    EXPECT_NE(decoder.decode(std::span(jpeg).first(length), picture), FrameFault::none) << length;
  }
  EXPECT_EQ(decoder.decode(random_bytes(5000), picture), FrameFault::no_image);
  EXPECT_EQ(decoder.decode(encoded(cv::Mat(32, 64, CV_8UC3, cv::Scalar(1, 2, 3))), picture),
            FrameFault::wrong_size);
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {  // flipped bits may pass unseen, but must not break anything
    auto damaged = jpeg;
    damaged[random() % damaged.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
    decoder.decode(damaged, picture);
  }
  EXPECT_EQ(decoder.decode(jpeg, picture), FrameFault::none);
}

TEST(FramePool, UsesMemoryAgainOnceItWasLetGo) {
  FramePool pool;
  for (int i = 0; i < 100; ++i) {
    const cv::Mat one = pool.picture(480, 640, CV_8UC3);
    const cv::Mat two = pool.picture(480, 640, CV_8UC3);
    EXPECT_NE(one.data, two.data);
    EXPECT_TRUE(one.isContinuous());
  }
  EXPECT_EQ(pool.blocks_made(), 2U);
}

TEST(FramePool, PicturesMayBeLetGoByAnotherThreadAndAfterThePool) {
  cv::Mat last;
  {
    FramePool pool;
    for (int i = 0; i < 50; ++i) {
      std::thread([picture = pool.picture(48, 64, CV_8UC1)]() mutable { picture.release(); }).join();
    }
    EXPECT_EQ(pool.blocks_made(), 1U);
    last = pool.picture(48, 64, CV_8UC1);
  }
  last.setTo(3);
  EXPECT_EQ(cv::countNonZero(last), 48 * 64);
}

TEST(LinuxVideoSystem, ReadsSerialAndPortOfAUsbCameraFromSysfs) {
  namespace fs = std::filesystem;
  const fs::path root = fs::path(testing::TempDir()) / "eigenpose-sysfs";
  fs::remove_all(root);
  const fs::path usb = root / "sys/devices/pci0000:00/usb1/1-2";
  fs::create_directories(usb / "1-2:1.0");
  std::ofstream(usb / "idVendor") << "046d\n";
  std::ofstream(usb / "serial") << "CAM42\n";
  for (const std::string node : {"video10", "video2"}) {
    const fs::path folder = root / "sys/class/video4linux" / node;
    fs::create_directories(folder);
    std::ofstream(folder / "name") << "HD Webcam\n";
    fs::create_symlink(usb / "1-2:1.0", folder / "device");
  }
  fs::create_directories(root / "dev");
  const auto nodes = LinuxVideoSystem(root / "dev", root / "sys").nodes();
  fs::remove_all(root);
  ASSERT_EQ(nodes.size(), 2U);
  EXPECT_EQ(nodes[0].path, (root / "dev/video2").string());
  EXPECT_EQ(nodes[1].path, (root / "dev/video10").string());
  EXPECT_EQ(nodes[0].serial, "CAM42");
  EXPECT_EQ(nodes[0].port, "1-2");
  EXPECT_EQ(nodes[0].name, "HD Webcam");
  EXPECT_EQ(nodes[0].open_error, ENOENT);
}

}  // namespace
}  // namespace eigenpose::test
