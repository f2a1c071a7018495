#include "core/dataset/coil_import.h"

#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/image/picture_file.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class CoilImport : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path from() const { return folder_.path() / "pictures"; }
  [[nodiscard]] std::filesystem::path to() const { return folder_.path() / "sets"; }
  /// A bar of `side` pixels in a picture of 40.
  void picture(const std::string& name, int side, int level = 100, int size = 40) const {
    std::filesystem::create_directories(from());
    cv::Mat image(size, size, CV_8UC1, cv::Scalar(0));
    cv::rectangle(image, {size / 2 - 8, (size - side) / 2, 16, side}, level, cv::FILLED);
    const auto bytes = encode_png(image);
    std::ofstream(from() / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  void turn(const std::string& object, int views, int step, int side = 20) const {
    for (int i = 0; i < views; ++i) picture(object + "__" + std::to_string(i * step) + ".png", side, 100 + i);
  }
  [[nodiscard]] ImportReport import(double degrees_per_step) const {
    return import_coil(from(), to(), {{degrees_per_step}});
  }
  [[nodiscard]] std::string refusal(double degrees_per_step, BadViews bad_views = BadViews::leave_out) const {
    try {
      (void)import_coil(from(), to(), {{degrees_per_step}, ViewKind::measured, bad_views});
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(CoilImport, ReadsAnIndexAsStepsAndANumberAsDegrees) {
  turn("obj2", 12, 1);
  turn("obj10", 12, 1);
  EXPECT_EQ(import(30.0).sets.size(), 2U);
  const auto sets = open_image_sets(to());
  EXPECT_EQ(sets[0].object(), "obj2");
  EXPECT_EQ(sets[1].object(), "obj10");
  EXPECT_DOUBLE_EQ(sets[1].views()[11].q[0], 330.0);
  EXPECT_EQ(sets[1].load(11).at<unsigned char>(20, 20), 111) << "numbers in their order, not 1, 10, 11, 2";
}

TEST_F(CoilImport, MeasuresWhetherViewsAreCropped) {
  turn("obj1", 12, 1, 40);
  EXPECT_TRUE(import(30.0).cropped);
  EXPECT_TRUE(open_image_sets(to())[0].cropped());
  std::filesystem::remove_all(to());
  turn("obj1", 12, 1, 20);
  EXPECT_FALSE(import(30.0).cropped);
  EXPECT_FALSE(open_image_sets(to())[0].cropped());
}

TEST_F(CoilImport, TakesUnevenAnglesAndDecimals) {
  for (const char* angle : {"0", "7.5", "91", "180.25", "300"})
    picture(std::string("obj1__") + angle + ".png", 20);
  const ImportReport report = import(1.0);
  EXPECT_THAT(report.warnings, IsEmpty());
  const ImageSet set = ImageSet::open(to() / "obj1");
  ASSERT_EQ(set.views().size(), 5U);
  EXPECT_DOUBLE_EQ(set.views()[1].q[0], 7.5);
  EXPECT_DOUBLE_EQ(set.views()[3].q[0], 180.25);
}

TEST_F(CoilImport, WarnsOfAGapAndRefusesItWhereAsked) {
  turn("obj1", 12, 30);
  for (const char* missing : {"60", "90", "120"})
    std::filesystem::remove(from() / (std::string("obj1__") + missing + ".png"));
  EXPECT_THAT(refusal(1.0, BadViews::refuse),
              AllOf(HasSubstr("the 9 views of \"obj1\""), HasSubstr("a gap of 120 degrees after 30"),
                    HasSubstr("40 degrees apart"), HasSubstr("--angle")));
  EXPECT_FALSE(std::filesystem::exists(to()));
  const ImportReport report = import(1.0);
  EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("a gap of 120 degrees after 30")));
  EXPECT_EQ(ImageSet::open(to() / "obj1").views().size(), 9U);
}

TEST_F(CoilImport, NamesTheGapThatAWrongStepLeaves) {
  turn("obj1", 3, 1);
  EXPECT_THAT(refusal(90.0, BadViews::refuse),
              AllOf(HasSubstr("a gap of 180 degrees after 180"), HasSubstr("120 degrees apart")));
}

TEST_F(CoilImport, RefusesAnglesBeyondATurnOtherNamesAndOneNumberTwice) {
  turn("obj1", 12, 30);
  EXPECT_EQ(refusal(1.0), "accepted");
  std::filesystem::remove_all(to());
  EXPECT_THAT(refusal(5.0),
              AllOf(HasSubstr("obj1__90.png"), HasSubstr("at 450 degrees"), HasSubstr("--angle")));
  picture("notes.png", 20);
  EXPECT_THAT(refusal(1.0), HasSubstr("not named as COIL pictures"));
  std::filesystem::remove(from() / "notes.png");
  picture("obj1__030.png", 20);
  EXPECT_THAT(refusal(1.0), HasSubstr("same number"));
  std::filesystem::remove(from() / "obj1__030.png");
  picture("obj2__0.png", 20);
  EXPECT_THAT(refusal(1.0), AllOf(HasSubstr("1 picture(s) of \"obj2\""), HasSubstr("at least 3")));
  EXPECT_FALSE(std::filesystem::exists(to())) << "names are checked before anything is written";
}

TEST_F(CoilImport, LeavesOutTruncatedPicturesAndOtherSizesByName) {
  turn("obj1", 12, 30);
  std::filesystem::resize_file(from() / "obj1__330.png", 60);
  picture("obj1__60.png", 20, 100, 41);
  const ImportReport report = import(1.0);
  ASSERT_EQ(report.left_out.size(), 2U);
  EXPECT_EQ(report.left_out[0].file.filename(), "obj1__60.png");
  EXPECT_THAT(report.left_out[0].reason, AllOf(HasSubstr("41x41 grey"), HasSubstr("40x40 grey")));
  EXPECT_EQ(report.left_out[1].file.filename(), "obj1__330.png");
  EXPECT_THAT(report.left_out[1].reason, HasSubstr("truncated"));
  EXPECT_EQ(report.sets[0].views, 10U);
  EXPECT_EQ(ImageSet::open(to() / "obj1").views().size(), 10U);
  EXPECT_TRUE(ImageSet::open(to() / "obj1").complete());
}

TEST_F(CoilImport, LeavesOutAnObjectOfWhichTooFewPicturesCanBeUsed) {
  turn("obj1", 3, 120);
  turn("obj2", 3, 120);
  std::filesystem::resize_file(from() / "obj1__0.png", 60);
  const ImportReport report = import(1.0);
  ASSERT_EQ(report.sets.size(), 1U);
  EXPECT_EQ(report.sets[0].object, "obj2");
  ASSERT_EQ(report.left_out.size(), 2U);
  EXPECT_FALSE(report.left_out[0].whole_object);
  EXPECT_TRUE(report.left_out[1].whole_object);
  EXPECT_THAT(report.left_out[1].text(),
              AllOf(HasSubstr("obj1"), HasSubstr("2 of 3"), HasSubstr("at least 3")));
  EXPECT_FALSE(std::filesystem::exists(to() / "obj1"));
}

TEST_F(CoilImport, RefusesTheFirstPictureThatCannotBeUsedWhereAsked) {
  turn("obj1", 12, 30);
  std::filesystem::resize_file(from() / "obj1__330.png", 60);
  EXPECT_THAT(refusal(1.0, BadViews::refuse), AllOf(HasSubstr("obj1__330.png"), HasSubstr("truncated")));
  picture("obj1__330.png", 20, 100, 41);
  EXPECT_THAT(refusal(1.0, BadViews::refuse), HasSubstr("41x41"));
  EXPECT_FALSE(ImageSet::open(to() / "obj1").complete());
}

TEST_F(CoilImport, ContinuesWhereItWasBrokenOff) {
  turn("obj1", 6, 60);
  turn("obj2", 6, 60);
  std::stop_source stop;
  const auto in_the_second = [&](const ProgressUpdate& update) {
    if (update.done == 9) stop.request_stop();
  };
  EXPECT_THROW(import_coil(from(), to(), {{1.0}}, in_the_second, stop.get_token()), Interrupted);
  EXPECT_TRUE(ImageSet::open(to() / "obj1").complete());
  EXPECT_FALSE(ImageSet::open(to() / "obj2").complete());
  const ImportReport report = import(1.0);
  ASSERT_EQ(report.sets.size(), 2U);
  EXPECT_TRUE(report.sets[0].stood_there);
  EXPECT_FALSE(report.sets[1].stood_there);
  EXPECT_EQ(ImageSet::open(to() / "obj2").views().size(), 6U);
}

TEST_F(CoilImport, RemovesNothingThatOthersHaveBegunOrFinished) {
  turn("obj1", 6, 60);
  {
    ImageSetWriter acquisition(to(), "obj1", turntable_workspace(), {{"acquired", true}});
    for (int i = 0; i < 4; ++i) acquisition.add(cv::Mat(40, 40, CV_8UC1, cv::Scalar(9)), {10.0 * i});
  }
  EXPECT_THAT(refusal(1.0), AllOf(HasSubstr("unfinished"), HasSubstr("4 views"), HasSubstr("obj1")));
  EXPECT_EQ(ImageSet::open(to() / "obj1").views().size(), 4U);
  ImageSetWriter(to(), "obj1", turntable_workspace(), {{"acquired", true}}).finish();
  EXPECT_THAT(refusal(1.0), HasSubstr("is an image set already"));
  EXPECT_EQ(ImageSet::open(to() / "obj1").views().size(), 4U);
}

TEST_F(CoilImport, RefusesAnEmptyOrMissingFolder) {
  EXPECT_THAT(refusal(1.0), HasSubstr("is not a folder"));
  std::filesystem::create_directories(from());
  EXPECT_THAT(refusal(1.0), HasSubstr("holds no picture"));
}

}  // namespace
}  // namespace eigenpose
