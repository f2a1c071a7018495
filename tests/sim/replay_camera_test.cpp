#include "sim/camera/replay_camera.h"

#include <cstdlib>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Folder {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("eigenpose-replay-" + std::to_string(::getpid()));
  Folder() {
    std::filesystem::remove_all(path);
    std::filesystem::create_directories(path);
  }
  ~Folder() { std::filesystem::remove_all(path); }
};

/// Pictures of two objects at 0°, 90°, 180° and 270°: a square whose brightness tells object and angle.
struct Replay : testing::Test {
  Folder folder;
  ManualClock clock{TimePoint(seconds(10))};
  SimLab lab{clock};

  void SetUp() override {
    for (int object = 1; object <= 2; ++object) {
      for (int index = 0; index < 4; ++index) {
        cv::Mat picture(48, 64, CV_8UC1, cv::Scalar(4));
        picture(cv::Rect(24, 16, 16, 16)).setTo(100 * object + 10 * index - 50);
        cv::imwrite((folder.path / ("thing" + std::to_string(object) + "__" + std::to_string(index) + ".png"))
                        .string(),
                    picture);
      }
    }
  }
  ReplayCamera opened(double noise = 0.0) {
    ReplayCameraOptions options;
    options.folder = folder.path;
    options.degrees_per_index = 90.0;
    options.noise = noise;
    return {lab, options};
  }
  cv::Mat picture(ReplayCamera& camera) {
    clock.advance(milliseconds(100));
    return camera.next_frame(clock.now(), {}).image;
  }
};

TEST_F(Replay, ShowsTheNearestAngleOfWhatWasPlaced) {
  ReplayCamera camera = opened();
  EXPECT_EQ(camera.info().width, 64);
  lab.place("thing2", degrees(90));
  EXPECT_EQ(picture(camera).at<std::uint8_t>(20, 30), 160);
  lab.set_axis_position(LabAxis::table, degrees(80));  // 170°: nearest is 180°
  EXPECT_EQ(picture(camera).at<std::uint8_t>(20, 30), 170);
  lab.set_axis_position(LabAxis::table, degrees(-120));  // 330°: nearest is 0°
  EXPECT_EQ(picture(camera).at<std::uint8_t>(20, 30), 150);
}

TEST_F(Replay, AnEmptyTableIsTheBackgroundOfThePictures) {
  ReplayCamera camera = opened();
  EXPECT_EQ(cv::countNonZero(picture(camera) != 4), 0);
  lab.place("mug");  // known to the lab, but not recorded
  EXPECT_EQ(cv::countNonZero(picture(camera) != 4), 0);
}

TEST_F(Replay, SeveralObjectsLieOverEachOtherAtTheirPlaces) {
  ReplayCamera camera = opened();
  lab.place("thing1");
  lab.place("thing2", {}, 75.0, 0.0);  // 64 pixels stand for 300 mm: 16 pixels to the right
  const cv::Mat both = picture(camera);
  EXPECT_EQ(both.at<std::uint8_t>(20, 30), 50);
  EXPECT_EQ(both.at<std::uint8_t>(20, 46), 150);
}

TEST_F(Replay, AnObjectLiesWhereTheCameraSeesItsPlace) {
  ReplayCamera camera = opened();
  struct Place {
    double x_mm, y_mm;
    int dx, dy;  ///< pixels: 64 for 300 mm, and in the depth of the table sin(32°) of that, upwards
  };
  for (const Place& place : {Place{0, 0, 0, 0}, Place{75, 0, 16, 0}, Place{-75, 0, -16, 0},
                             Place{0, 100, 0, -11}, Place{0, -100, 0, 11}, Place{60, -60, 13, 7}}) {
    lab.clear();
    lab.place("thing1", {}, place.x_mm, place.y_mm);
    cv::Mat expected(48, 64, CV_8UC1, cv::Scalar(4));
    expected(cv::Rect(24 + place.dx, 16 + place.dy, 16, 16)).setTo(50);
    EXPECT_EQ(cv::norm(picture(camera), expected, cv::NORM_INF), 0.0) << place.x_mm << "," << place.y_mm;
  }
}

TEST_F(Replay, NoiseDiffersFromFrameToFrame) {
  ReplayCamera camera = opened(2.0);
  lab.place("thing2");
  const cv::Mat a = picture(camera).clone();
  const cv::Mat b = picture(camera).clone();
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(a(cv::Rect(24, 16, 16, 16)), mean, deviation);
  EXPECT_NEAR(deviation[0], 2.0, 0.5);  // of 256 draws
  EXPECT_GT(cv::norm(a, b, cv::NORM_L1), 0.0);
}

TEST_F(Replay, RefusesFoldersItCannotShow) {
  ReplayCameraOptions options;
  options.folder = folder.path / "nowhere";
  EXPECT_THROW(ReplayCamera(lab, options), FileError);
  std::filesystem::create_directories(options.folder);
  EXPECT_THROW(ReplayCamera(lab, options), FileError);
  cv::imwrite((folder.path / "thing3__0.png").string(), cv::Mat(10, 10, CV_8UC1, cv::Scalar(1)));
  options.folder = folder.path;
  EXPECT_THROW(ReplayCamera(lab, options), FileError);
}

TEST_F(Replay, ServesTheUnprocessedColumbiaImages) {
  const char* datasets = std::getenv("EIGENPOSE_DATASETS");
  ReplayCameraOptions options;
  if (datasets != nullptr) options.folder = std::filesystem::path(datasets) / "coil-20-unprocessed";
  if (datasets == nullptr || !std::filesystem::is_directory(options.folder)) {
    GTEST_SKIP()
        << "EIGENPOSE_DATASETS has no coil-20-unprocessed: the replay of real photographs was not shown";
  }
  options.noise = 0.0;
  ReplayCamera camera(lab, options);
  lab.place("obj3", degrees(85));
  const cv::Mat recorded = cv::imread((options.folder / "obj3__17.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(picture(camera), cv::max(recorded, 0.0), cv::NORM_INF, recorded > 10), 0.0);
}

}  // namespace
}  // namespace eigenpose::sim
