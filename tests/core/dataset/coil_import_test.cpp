#include "core/dataset/coil_import.h"

#include <fstream>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/image/picture_file.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;

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
  [[nodiscard]] std::string refusal(double degrees_per_step) const {
    try {
      (void)import(degrees_per_step);
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

TEST_F(CoilImport, RefusesGapsWrongAnglesAndStrangers) {
  turn("obj1", 12, 30);
  EXPECT_EQ(refusal(1.0), "accepted");
  std::filesystem::remove_all(to());
  EXPECT_THAT(refusal(5.0), HasSubstr("breaks the even turn"));
  std::filesystem::remove(from() / "obj1__90.png");
  EXPECT_THAT(refusal(1.0), HasSubstr("picture is missing"));
  turn("obj1", 12, 30);
  picture("notes.png", 20);
  EXPECT_THAT(refusal(1.0), HasSubstr("not named as COIL pictures"));
  std::filesystem::remove(from() / "notes.png");
  picture("obj1__030.png", 20);
  EXPECT_THAT(refusal(1.0), HasSubstr("same number"));
  EXPECT_FALSE(std::filesystem::exists(to())) << "names are checked before anything is written";
}

TEST_F(CoilImport, RefusesTruncatedPicturesAndTwoSizesAndLeavesNoCompleteSet) {
  turn("obj1", 12, 30);
  std::filesystem::resize_file(from() / "obj1__330.png", 60);
  EXPECT_THAT(refusal(1.0), HasSubstr("truncated"));
  picture("obj1__330.png", 20, 100, 41);
  EXPECT_THAT(refusal(1.0), HasSubstr("41x41"));
  EXPECT_FALSE(ImageSet::open(to() / "obj1").complete());
  picture("obj1__330.png", 20);
  EXPECT_EQ(refusal(1.0), "accepted") << "a broken-off import starts again";
  EXPECT_EQ(ImageSet::open(to() / "obj1").views().size(), 12U);
}

TEST_F(CoilImport, RefusesAnEmptyOrMissingFolder) {
  EXPECT_THAT(refusal(1.0), HasSubstr("is not a folder"));
  std::filesystem::create_directories(from());
  EXPECT_THAT(refusal(1.0), HasSubstr("holds no picture"));
}

}  // namespace
}  // namespace eigenpose
