#include "core/dataset/table_import.h"

#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::DoubleEq;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class TableImport : public ::testing::Test {
 protected:
  TableImport() {
    std::filesystem::create_directories(folder_.path() / "shots");
    for (int i = 0; i < 8; ++i)
      cv::imwrite((folder_.path() / "shots" / ("p" + std::to_string(i) + ".png")).string(),
                  cv::Mat(20, 20, CV_8UC1, cv::Scalar(20 + i)));
  }
  [[nodiscard]] std::filesystem::path table(const std::string& text) const {
    const auto file = folder_.path() / "poses.csv";
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  [[nodiscard]] ImportReport import(const std::string& text, const TableImportOptions& options = {}) const {
    return import_table(table(text), sets(), options);
  }
  [[nodiscard]] std::string refusal(const std::string& text, const TableImportOptions& options = {}) const {
    try {
      (void)import(text, options);
    } catch (const std::exception& error) {
      return error.what();
    }
    std::filesystem::remove_all(sets());
    return "accepted";
  }
  [[nodiscard]] std::filesystem::path sets() const { return folder_.path() / "sets"; }
  [[nodiscard]] Dof only_dof(const std::string& text, const TableImportOptions& options = {}) const {
    std::filesystem::remove_all(sets());
    (void)import(text, options);
    return ImageSet::open(sets() / "mug").workspace()[0];
  }
  /// A table of one object with these values.
  static std::string values(const std::string& column, const std::vector<std::string>& list) {
    std::string text = "file,object," + column + "\n";
    for (std::size_t i = 0; i < list.size(); ++i)
      text += "shots/p" + std::to_string(i) + ".png,mug," + list[i] + "\n";
    return text;
  }

  test::TemporaryFolder folder_;
};

TEST_F(TableImport, ReadsObjectsPosesAndUnitsWhateverTheOrderOfColumns) {
  const ImportReport report = import(
      "x_mm,object,file,table_deg\r\n-1.5,mug,shots/p0.png,0\r\n2,obj10,shots/p1.png,120\r\n"
      "2.5,mug,shots/p2.png,240\r\n3,mug,shots/p3.png,1e1\r\n1,obj2,shots/p4.png,60\r\n");
  ASSERT_EQ(report.sets.size(), 3U);
  EXPECT_EQ(report.sets[1].object, "obj2") << "numbers as numbers";
  const ImageSet mug = ImageSet::open(sets() / "mug");
  ASSERT_EQ(mug.views().size(), 3U);
  EXPECT_EQ(mug.workspace()[0], (Dof{"x", "mm", -1.5, 3.0, false}));
  EXPECT_EQ(mug.workspace()[1], (Dof{"table", "deg", 0.0, 360.0, true}));
  EXPECT_EQ(mug.views()[1].q, (std::vector<double>{2.5, 240.0}));
  EXPECT_EQ(mug.load(2).at<unsigned char>(3, 3), 23);
  EXPECT_EQ(ImageSet::open(sets() / "obj2").workspace(), mug.workspace()) << "one workspace for all";
}

TEST_F(TableImport, ClosesAnglesWithoutALargeGapAndNoOthers) {
  EXPECT_TRUE(only_dof(values("table_deg", {"0", "120", "240"})).periodic);
  EXPECT_TRUE(only_dof(values("table_deg", {"-180", "-60", "60"})).periodic);
  EXPECT_EQ(only_dof(values("light_deg", {"-60", "0", "60"})), (Dof{"light", "deg", -60.0, 60.0, false}));
  EXPECT_FALSE(only_dof(values("table_deg", {"0", "121", "240"})).periodic) << "a gap of 121 degrees";
  const Dof radians = only_dof(values("turn_rad", {"0", "1.5", "3", "4.5"}));
  EXPECT_TRUE(radians.periodic) << "the largest gap is 1.78 of 6.28";
  EXPECT_THAT(radians.upper, DoubleEq(2.0 * std::numbers::pi));
  EXPECT_FALSE(only_dof(values("x_mm", {"0", "120", "240"})).periodic);
}

TEST_F(TableImport, LetsOptionsSayWhatCloses) {
  EXPECT_TRUE(only_dof(values("light_deg", {"-60", "0", "60"}), {.periodic = {"light"}}).periodic);
  EXPECT_FALSE(only_dof(values("table_deg", {"0", "120", "240"}), {.open = {"table_deg"}}).periodic);
  const std::string text = values("x_mm", {"0", "1", "2"});
  EXPECT_THAT(refusal(text, {.periodic = {"x"}}), AllOf(HasSubstr("x_mm"), HasSubstr("no unit of angles")));
  EXPECT_THAT(refusal(text, {.periodic = {"y"}}), HasSubstr("\"y\" is to be periodic, but no column"));
  EXPECT_THAT(refusal(text, {.open = {"y"}}), HasSubstr("\"y\" is to be open, but no column"));
  EXPECT_THAT(refusal(text, {.ignore = {"y"}}), HasSubstr("\"y\" is to be ignored"));
  EXPECT_THAT(refusal(text, {.ignore = {"file"}}), HasSubstr("\"file\" is to be ignored"));
  EXPECT_THAT(refusal(values("a_deg", {"0", "1", "2"}), {.periodic = {"a"}, .open = {"a_deg"}}),
              HasSubstr("periodic and open"));
}

TEST_F(TableImport, LeavesOutColumnsThatAreToBeIgnoredOrNeverChange) {
  const std::string text =
      "file,object,note,light_deg,table_deg\nshots/p0.png,mug,\"a, b\",30,0\nshots/p1.png,mug,,30,120\n"
      "shots/p2.png,mug,c,30,240\n";
  EXPECT_THAT(refusal(text), AllOf(HasSubstr("line 1"), HasSubstr("\"note\""), HasSubstr("deg, rad")));
  const ImportReport report = import(text, {.ignore = {"note"}});
  EXPECT_THAT(report.warnings, ElementsAre(AllOf(HasSubstr("light_deg"), HasSubstr("same value"))));
  EXPECT_EQ(ImageSet::open(sets() / "mug").workspace().size(), 1U);
  EXPECT_THAT(refusal(values("x_mm", {"1", "1", "1"})), HasSubstr("the same pose"));
}

TEST_F(TableImport, TakesFileNamesWithCommasAndAbsolutePaths) {
  std::filesystem::rename(folder_.path() / "shots/p1.png", folder_.path() / "shots/a, \"b\".png");
  const std::string absolute = (folder_.path() / "shots/p2.png").string();
  const ImportReport report =
      import("file,object,table_deg\nshots/p0.png,mug,0\n\"shots/a, \"\"b\"\".png\",mug,120\n" + absolute +
             ",mug,240\n");
  EXPECT_EQ(report.sets[0].views, 3U);
  EXPECT_THAT(report.left_out, IsEmpty());
}

TEST_F(TableImport, NamesTheLineOfEveryFault) {
  const std::string head = "file,object,table_deg\nshots/p0.png,mug,0\n";
  const auto line3 = [&](const std::string& row) { return refusal(head + row + "\n"); };
  EXPECT_THAT(line3("shots/p1.png,mug,12;5"), AllOf(HasSubstr("line 3"), HasSubstr("table_deg is \"12;5\"")));
  EXPECT_THAT(line3("shots/p1.png,mug,\"12,5\""), AllOf(HasSubstr("line 3"), HasSubstr("12.5")));
  EXPECT_THAT(line3("shots/p1.png,mug,12 deg"), HasSubstr("line 3"));
  EXPECT_THAT(line3("shots/p1.png,mug,nan"), HasSubstr("line 3"));
  EXPECT_THAT(line3("shots/p1.png,mug,inf"), HasSubstr("line 3"));
  EXPECT_THAT(line3("shots/p1.png,mug,1e300"), AllOf(HasSubstr("line 3"), HasSubstr("1e9")));
  EXPECT_THAT(line3("shots/p1.png,mug,"), AllOf(HasSubstr("line 3"), HasSubstr("table_deg is empty")));
  EXPECT_THAT(line3("shots/none.png,mug,1"), AllOf(HasSubstr("line 3"), HasSubstr("none.png")));
  EXPECT_THAT(line3("shots,mug,1"), AllOf(HasSubstr("line 3"), HasSubstr("no picture")));
  EXPECT_THAT(line3(",mug,1"), AllOf(HasSubstr("line 3"), HasSubstr("file is empty")));
  EXPECT_THAT(line3("shots/p1.png,my mug,1"), AllOf(HasSubstr("line 3"), HasSubstr("my mug")));
  EXPECT_THAT(line3("shots/p1.png,../mug,1"), HasSubstr("line 3"));
  EXPECT_THAT(line3("shots/../shots/p0.png,mug,1"), AllOf(HasSubstr("line 3"), HasSubstr("line 2 already")));
  EXPECT_THAT(line3("shots/p1.png,mug"), AllOf(HasSubstr("line 3"), HasSubstr("2 fields")));
  EXPECT_FALSE(std::filesystem::exists(sets())) << "all of the table is checked before anything is written";
}

TEST_F(TableImport, NamesColumnsThatAreMissingDoubledOrNoDof) {
  EXPECT_THAT(refusal("object,table_deg\nmug,1\n"), HasSubstr("no column \"file\""));
  EXPECT_THAT(refusal("file,table_deg\nshots/p0.png,1\n"), HasSubstr("no column \"object\""));
  EXPECT_THAT(refusal("file,object\nshots/p0.png,mug\n"), HasSubstr("no column gives a pose"));
  EXPECT_THAT(refusal("file,object,x_mm,x_mm\nshots/p0.png,mug,1,1\n"), HasSubstr("two columns"));
  EXPECT_THAT(refusal("file,object,x_mm,x_cm\nshots/p0.png,mug,1,1\n"), HasSubstr("one DOF in two units"));
  EXPECT_THAT(refusal("file,object,table\nshots/p0.png,mug,1\n"), HasSubstr("does not end in a unit"));
  EXPECT_THAT(refusal("file,object,_deg\nshots/p0.png,mug,1\n"), HasSubstr("does not end in a unit"));
  EXPECT_THAT(refusal("file;object;table_deg\nshots/p0.png;mug;1\n"), HasSubstr("not separated by commas"));
}

TEST_F(TableImport, LeavesOutABrokenPictureOrRefusesIt) {
  std::filesystem::resize_file(folder_.path() / "shots/p3.png", 30);
  const std::string text = values("table_deg", {"0", "90", "180", "200", "270"});
  EXPECT_THAT(refusal(text, {.bad_views = BadViews::refuse}), HasSubstr("p3.png"));
  std::filesystem::remove_all(sets());
  const ImportReport report = import(text);
  ASSERT_EQ(report.left_out.size(), 1U);
  EXPECT_THAT(report.left_out[0].text(),
              AllOf(HasSubstr("mug"), HasSubstr("p3.png"), HasSubstr("truncated")));
  EXPECT_EQ(ImageSet::open(sets() / "mug").views().size(), 4U);
  const ImportReport again = import(text);
  EXPECT_TRUE(again.sets[0].stood_there) << "the same import again finds its work done";
  EXPECT_EQ(again.sets[0].views, 4U);
}

TEST_F(TableImport, TakesViewsAsTold) {
  const std::string text = values("table_deg", {"0", "120", "240"});
  (void)import(text, {.views = ViewKind::cropped});
  EXPECT_TRUE(ImageSet::open(sets() / "mug").cropped());
  std::filesystem::remove_all(sets());
  (void)import(text, {.views = ViewKind::scene});
  EXPECT_FALSE(ImageSet::open(sets() / "mug").cropped());
}

}  // namespace
}  // namespace eigenpose
