#include "core/dataset/image_set.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class ImageSetFiles : public ::testing::Test {
 protected:
  [[nodiscard]] const std::filesystem::path& root() const { return folder_.path(); }
  static cv::Mat picture(int level) { return {cv::Size(8, 6), CV_8UC1, cv::Scalar(level)}; }
  void make(const std::string& object, int views, bool finish = true) const {
    ImageSetWriter writer(root(), object, turntable_workspace(), {{"from", "a test"}});
    for (int i = 0; i < views; ++i) writer.add(picture(10 + i), {i * 10.0});
    if (finish) writer.finish();
  }
  static void write(const std::filesystem::path& file, const std::string& text) {
    std::ofstream(file) << text;
  }
  static std::string read(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(ImageSetFiles, GivesBackViewsAndPoses) {
  make("mug", 5);
  const ImageSet set = ImageSet::open(root() / "mug");
  EXPECT_EQ(set.object(), "mug");
  EXPECT_EQ(set.workspace(), turntable_workspace());
  EXPECT_TRUE(set.complete());
  EXPECT_FALSE(set.cropped());
  ASSERT_EQ(set.views().size(), 5U);
  EXPECT_EQ(set.views()[3].q, std::vector<double>{30.0});
  EXPECT_EQ(set.load(3).at<unsigned char>(0, 0), 13);
}

TEST_F(ImageSetFiles, KeepsPosesCanonicalAndFurtherFacts) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object(), {.cropped = true});
  writer.add(picture(1), {-10.0}, {{"exposure_us", 5}});
  writer.finish();
  const ImageSet set = ImageSet::open(root() / "mug");
  EXPECT_TRUE(set.cropped());
  EXPECT_DOUBLE_EQ(set.views()[0].q[0], 350.0);
  EXPECT_THAT(read(root() / "mug/views.jsonl"), HasSubstr("\"exposure_us\":5"));
}

TEST_F(ImageSetFiles, ContinuesWhatWasBrokenOff) {
  make("mug", 3, false);
  // A crash in the middle of `add`: half a line.
  std::ofstream(root() / "mug/views.jsonl", std::ios::app) << R"({"file": "0000)";
  EXPECT_FALSE(ImageSet::open(root() / "mug").complete());
  EXPECT_EQ(ImageSet::open(root() / "mug").views().size(), 3U);
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object());
  EXPECT_EQ(writer.views().size(), 3U);
  writer.add(picture(99), {30.0});
  writer.finish();
  const ImageSet set = ImageSet::open(root() / "mug");
  ASSERT_EQ(set.views().size(), 4U);
  EXPECT_EQ(set.load(2).at<unsigned char>(0, 0), 12);
  EXPECT_EQ(set.load(3).at<unsigned char>(0, 0), 99);
}

TEST_F(ImageSetFiles, NeverWritesOverACompleteSet) {
  make("mug", 3);
  EXPECT_THAT([&] { make("mug", 3); }, ThrowsMessage<FileError>(HasSubstr("complete image set already")));
  EXPECT_EQ(ImageSet::open(root() / "mug").views().size(), 3U);
}

TEST_F(ImageSetFiles, RefusesNamesThatLeaveTheFolder) {
  for (const char* name : {"", "..", "a/b", "-x", ".hidden", "mug cup"})
    EXPECT_THROW(make(name, 1), std::invalid_argument) << name;
}

TEST_F(ImageSetFiles, AFailedViewLeavesTheSetAsItWas) {
  make("mug", 2, false);
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object());
  const std::string before = read(root() / "mug/views.jsonl");
  EXPECT_THROW(writer.add(picture(1), {1.0, 2.0}), std::invalid_argument);
  EXPECT_THROW(writer.add(cv::Mat(), {1.0}), std::invalid_argument);
  // The journal cannot be appended to: a folder stands in its place.
  std::filesystem::rename(root() / "mug/views.jsonl", root() / "mug/kept");
  std::filesystem::create_directory(root() / "mug/views.jsonl");
  EXPECT_THROW(writer.add(picture(1), {1.0}), FileError);
  std::filesystem::remove(root() / "mug/views.jsonl");
  std::filesystem::rename(root() / "mug/kept", root() / "mug/views.jsonl");
  EXPECT_EQ(read(root() / "mug/views.jsonl"), before);
  EXPECT_FALSE(std::filesystem::exists(root() / "mug/000002.png"));
  writer.add(picture(1), {20.0});
  writer.finish();
  EXPECT_EQ(ImageSet::open(root() / "mug").views().size(), 3U);
}

TEST_F(ImageSetFiles, SaysWhichLineIsWrong) {
  make("mug", 3);
  const auto journal = root() / "mug/views.jsonl";
  const std::string good = read(journal);
  const auto complaint = [&](const std::string& text) {
    write(journal, text);
    try {
      ImageSet::open(root() / "mug");
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(complaint(good + good), HasSubstr("line 4 names \"000000.png\" a second time"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\",\"q\":[1,2]}\n"), HasSubstr("line 1 \"q\" has 2 values"));
  EXPECT_THAT(complaint("{\"file\":\"../a.png\",\"q\":[1]}\n"), HasSubstr("not the name of a file"));
  EXPECT_THAT(complaint("garbage\n"), HasSubstr("line 1 is not a JSON object"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\"}\n"), HasSubstr("no \"q\""));
  EXPECT_THAT(complaint(good.substr(0, good.size() - 3)), HasSubstr("line 3 is cut off"));
  EXPECT_THAT(complaint(""), HasSubstr("holds no view"));
  EXPECT_EQ(complaint(good), "accepted");
}

TEST_F(ImageSetFiles, RefusesOtherFormatsAndVersions) {
  make("mug", 1);
  const auto index = root() / "mug/set.json";
  nlohmann::json all = nlohmann::json::parse(read(index));
  all["version"] = 2;
  write(index, all.dump());
  EXPECT_THAT([&] { ImageSet::open(root() / "mug"); }, ThrowsMessage<FileError>(HasSubstr("has version 2")));
  write(index, "{}");
  EXPECT_THROW(ImageSet::open(root() / "mug"), FileError);
  EXPECT_THROW(ImageSet::open(root() / "nothing"), FileError);
}

TEST_F(ImageSetFiles, AMissingOrTruncatedViewIsAnError) {
  make("mug", 3);
  const ImageSet set = ImageSet::open(root() / "mug");
  std::filesystem::resize_file(root() / "mug/000001.png", 50);
  std::filesystem::remove(root() / "mug/000002.png");
  EXPECT_NO_THROW((void)set.load(0));
  EXPECT_THAT([&] { (void)set.load(1); }, ThrowsMessage<FileError>(HasSubstr("truncated")));
  EXPECT_THROW((void)set.load(2), FileError);
}

TEST_F(ImageSetFiles, ListsSetsWithNumbersInTheirOrder) {
  for (const char* name : {"obj10", "obj9", "obj1", "cup"}) make(name, 1);
  std::vector<std::string> names;
  for (const ImageSet& set : open_image_sets(root())) names.push_back(set.object());
  EXPECT_THAT(names, ::testing::ElementsAre("cup", "obj1", "obj9", "obj10"));
  EXPECT_EQ(open_image_sets(root() / "obj9").size(), 1U);
  const test::TemporaryFolder empty;
  EXPECT_THROW(open_image_sets(empty.path()), FileError);
}

TEST_F(ImageSetFiles, AnEmptySetCannotBeComplete) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object());
  EXPECT_THROW(writer.finish(), FileError);
  EXPECT_TRUE(ImageSet::open(root() / "mug").views().empty());
}

}  // namespace
}  // namespace eigenpose
