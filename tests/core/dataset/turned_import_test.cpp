// Image sets made of one picture of parts that lie flat.
#include "core/dataset/turned_import.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A wide plate on the left, a disc on the right, something at the border.
cv::Mat two_parts() {
  cv::Mat picture(240, 320, CV_8UC1, cv::Scalar(20));
  cv::rectangle(picture, {30, 100, 80, 30}, 200, cv::FILLED);
  cv::circle(picture, {220, 120}, 25, 150, cv::FILLED);
  picture.col(319).setTo(255);
  return picture;
}

class TurnedImport : public ::testing::Test {
 protected:
  std::filesystem::path picture() {
    auto file = folder_.path() / "parts.png";
    cv::imwrite(file, two_parts());
    return file;
  }
  [[nodiscard]] std::filesystem::path sets() const { return folder_.path() / "sets"; }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(TurnedImport, TurnsEveryPartThatIsClearOfTheBorder) {
  const auto names = import_turned(picture(), sets(), {.names = {"plate", "disc"}, .views = 8});
  EXPECT_THAT(names, ElementsAre("plate", "disc"));
  const ImageSet plate = ImageSet::open(sets() / "plate");
  ASSERT_EQ(plate.views().size(), 8U);
  EXPECT_EQ(plate.views()[2].q, std::vector<double>{90.0});
  Segmenter segmenter;
  const auto flat = segmenter.segment(plate.load(0))[0].box;
  EXPECT_NEAR(flat.width, 80, 1);
  EXPECT_NEAR(flat.height, 30, 1);
  const auto upright = segmenter.segment(plate.load(2))[0].box;
  EXPECT_NEAR(upright.width, 30, 2);
  EXPECT_NEAR(upright.height, 80, 2);
  EXPECT_FALSE(segmenter.segment(plate.load(1))[0].touches_border) << "there is room to turn in";
}

/// Longer than any file system takes: looking it up fails otherwise than by its absence, also for root.
TEST_F(TurnedImport, AFolderThatCannotBeLookedUpIsAFileError) {
  EXPECT_THROW(
      import_turned(picture(), sets() / std::string(300, 'x'), {.names = {"plate", "disc"}, .views = 8}),
      FileError);
}

TEST_F(TurnedImport, TurnsCounterClockwise) {
  cv::Mat lopsided(200, 200, CV_8UC1, cv::Scalar(20));
  cv::rectangle(lopsided, {60, 90, 80, 20}, 120, cv::FILLED);
  cv::rectangle(lopsided, {120, 90, 20, 20}, 250, cv::FILLED);  // bright at its right end
  const auto file = sets().parent_path() / "lopsided.png";
  cv::imwrite(file, lopsided);
  import_turned(file, sets(), {.names = {"rod"}, .views = 4});
  const cv::Mat quarter = ImageSet::open(sets() / "rod").load(1);
  cv::Point brightest;
  cv::minMaxLoc(quarter, nullptr, nullptr, nullptr, &brightest);
  EXPECT_LT(brightest.y, quarter.rows / 2) << "the right end points up after a quarter turn";
}

TEST_F(TurnedImport, WhatATurnUncoversIsBackground) {
  import_turned(picture(), sets(), {.names = {"plate", "disc"}, .views = 8});
  for (const char* part : {"plate", "disc"}) {
    const ImageSet set = ImageSet::open(sets() / part);
    for (std::size_t i = 0; i < set.views().size(); ++i) {
      const cv::Mat view = set.load(i);
      for (const int y : {0, view.rows - 1})
        for (const int x : {0, view.cols - 1})
          EXPECT_EQ(view.at<std::uint8_t>(y, x), 20) << part << ", view " << i << " at " << x << "," << y;
    }
  }
}

TEST_F(TurnedImport, NamesPartsFromLeftToRightItself) {
  EXPECT_THAT(import_turned(picture(), sets(), {.views = 2}), ElementsAre("part1", "part2"));
}

TEST_F(TurnedImport, SaysWhatIsWrong) {
  try {
    import_turned(picture(), sets(), {.names = {"plate"}});
    FAIL() << "one name for two parts was taken";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("2 parts, but 1 names"));
  }
  EXPECT_THROW(import_turned(picture(), sets(), {.names = {"plate", "plate"}}), std::invalid_argument);
  EXPECT_THROW(import_turned(picture(), sets(), {.names = {"plate", "no name"}}), std::invalid_argument);
  std::filesystem::create_directories(sets() / "disc");
  EXPECT_THROW(import_turned(picture(), sets(), {.names = {"plate", "disc"}}), FileError);
  EXPECT_FALSE(std::filesystem::exists(sets() / "plate")) << "nothing was begun";
  EXPECT_THROW(import_turned(picture(), sets(), {.views = 1}), std::invalid_argument);
  const auto empty = sets().parent_path() / "empty.png";
  cv::imwrite(empty, cv::Mat(100, 100, CV_8UC1, cv::Scalar(20)));
  EXPECT_THROW(import_turned(empty, sets(), {}), FileError);
  EXPECT_THROW(import_turned(sets() / "absent.png", sets(), {}), FileError);
}

TEST_F(TurnedImport, ContinuesWhereItWasKilled) {
  const auto file = picture();
  const nlohmann::json source = {{"imported_from", std::filesystem::absolute(file).string()},
                                 {"turned", true}};
  (void)import_turned(file, sets(), {.names = {"plate", "disc"}, .views = 4});
  std::filesystem::remove_all(sets() / "disc");
  ImageSetWriter(sets(), "disc", turntable_workspace(), source)
      .add(cv::Mat(9, 9, CV_8UC1, cv::Scalar(1)), {0.0});
  const auto written = std::filesystem::last_write_time(sets() / "plate/000000.png");
  (void)import_turned(file, sets(), {.names = {"plate", "disc"}, .views = 4});
  EXPECT_EQ(ImageSet::open(sets() / "disc").views().size(), 4U);
  EXPECT_GT(ImageSet::open(sets() / "disc").load(0).rows, 9);
  EXPECT_EQ(std::filesystem::last_write_time(sets() / "plate/000000.png"), written)
      << "what was finished stays";
}

TEST_F(TurnedImport, RemovesNothingThatAnAcquisitionHasBegun) {
  ImageSetWriter(sets(), "disc", turntable_workspace(), nlohmann::json::object())
      .add(cv::Mat(9, 9, CV_8UC1, cv::Scalar(1)), {0.0});
  EXPECT_THROW(import_turned(picture(), sets(), {.names = {"plate", "disc"}, .views = 4}), FileError);
  EXPECT_EQ(ImageSet::open(sets() / "disc").views().size(), 1U);
  EXPECT_FALSE(std::filesystem::exists(sets() / "plate"));
}

TEST_F(TurnedImport, LeavesNoUnfinishedSetWhenInterrupted) {
  std::stop_source stop;
  const auto in_the_second = [&](const ProgressUpdate& report) {
    if (report.done == 5) stop.request_stop();
  };
  EXPECT_THROW(import_turned(picture(), sets(), {.names = {"plate", "disc"}, .views = 4}, in_the_second,
                             stop.get_token()),
               Interrupted);
  EXPECT_TRUE(ImageSet::open(sets() / "plate").complete());
  EXPECT_FALSE(std::filesystem::exists(sets() / "disc"));
}

}  // namespace
}  // namespace eigenpose
