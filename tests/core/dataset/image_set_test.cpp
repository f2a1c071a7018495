#include "core/dataset/image_set.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "core/base/error.h"
#include "tests/support/full_disk.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
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

TEST_F(ImageSetFiles, AContinuedSetKeepsTheSourceOfTheViewsItHas) {
  const auto source_in_file = [&] {
    return nlohmann::json::parse(read(root() / "mug" / "set.json")).at("source");
  };
  const nlohmann::json another = {{"from", "another test"}};
  make("mug", 0, false);
  EXPECT_EQ(ImageSetWriter(root(), "mug", turntable_workspace(), another).source(), another);
  EXPECT_EQ(source_in_file(), another) << "it had no view: its source is that of the views to come";
  std::filesystem::remove_all(root() / "mug");

  make("mug", 2, false);
  ImageSetWriter writer(root(), "mug", turntable_workspace(), another);
  EXPECT_EQ(writer.source(), nlohmann::json({{"from", "a test"}}));
  writer.finish();
  EXPECT_EQ(source_in_file(), nlohmann::json({{"from", "a test"}}));
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
  cv::Mat noise(60, 80, CV_8UC1);
  cv::randu(noise, 0, 255);
  {
    const test::FullDisk disk(before.size() + 10);
    EXPECT_THROW(writer.add(noise, {1.0}), FileError) << "the picture does not fit";
    // A picture of some 70 bytes fits, a line of 200 does not.
    EXPECT_THROW(writer.add(cv::Mat(1, 1, CV_8UC1, cv::Scalar(1)), {1.0}, {{"note", std::string(200, 'x')}}),
                 FileError);
  }
  EXPECT_EQ(read(root() / "mug/views.jsonl"), before);
  EXPECT_FALSE(std::filesystem::exists(root() / "mug/000002.png"));
  EXPECT_EQ(writer.views().size(), 2U);
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
  EXPECT_THAT(complaint(good + good), HasSubstr("line 4: it names \"000000.png\" a second time"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\",\"q\":[1,2]}\n"), HasSubstr("line 1: \"q\" has 2 values"));
  EXPECT_THAT(complaint("{\"file\":\"../a.png\",\"q\":[1]}\n"), HasSubstr("not the name of a file"));
  EXPECT_THAT(complaint("garbage\n"), HasSubstr("line 1: line 1, column 1: this is not JSON"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\"}\n"), HasSubstr("\"q\" is missing"));
  EXPECT_THAT(complaint(good.substr(0, good.size() - 3)), HasSubstr("line 3: it is cut off"));
  EXPECT_THAT(complaint(""), HasSubstr("holds no view"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\",\"q\":[true]}\n"), HasSubstr("\"q\" is true"));
  EXPECT_THAT(complaint("{\"file\":\"a.png\\u0000b\",\"q\":[1]}\n"), HasSubstr("not the name of a file"));
  EXPECT_THAT(
      complaint("{\"file\":\"a.png\",\"q\":" + std::string(90'000, '[') + std::string(90'000, ']') + "}\n"),
      HasSubstr("nested deeper than"));
  EXPECT_EQ(complaint(good), "accepted");
}

TEST_F(ImageSetFiles, SaysWhatIsWrongWithTheIndex) {
  make("mug", 1);
  const auto index = root() / "mug/set.json";
  const nlohmann::json good = nlohmann::json::parse(read(index));
  const auto complaint = [&](const char* path, const nlohmann::json& value) {
    nlohmann::json all = good;
    all[nlohmann::json::json_pointer(path)] = value;
    write(index, all.dump());
    try {
      ImageSet::open(root() / "mug");
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(complaint("/source", "elsewhere"), "accepted");
  for (const int version : {0, 2})
    EXPECT_THAT(complaint("/version", version), HasSubstr("it has version " + std::to_string(version)));
  EXPECT_THAT(complaint("/version", true), HasSubstr("\"version\" is true"));
  EXPECT_THAT(complaint("/version", 1.5), HasSubstr("\"version\" is 1.5"));
  EXPECT_THAT(complaint("/version", 4294967297), HasSubstr("\"version\" is 4294967297"));
  EXPECT_THAT(complaint("/format", "other"), HasSubstr("not of the format"));
  EXPECT_THAT(complaint("/object", "a\nlevel=error"),
              HasSubstr("\"a\\nlevel=error\" cannot be an object's name"));
  EXPECT_THAT(complaint("/complete", 1), HasSubstr("\"complete\" is 1"));
  EXPECT_THAT(complaint("/cropped", nullptr), HasSubstr("\"cropped\" is null"));
  EXPECT_THAT(complaint("/workspace", 3), HasSubstr("\"workspace\" is not an array"));
  EXPECT_THAT(complaint("/workspace/0", 3), HasSubstr("an object"));
  EXPECT_THAT(complaint("/workspace/0/upper", 0.0), HasSubstr("is not below upper"));
  EXPECT_THAT(complaint("/workspace/0/lower", "x"), HasSubstr("\"lower\" is \"x\""));
  write(index, R"({"workspace":)" + std::string(90'000, '[') + std::string(90'000, ']') + "}");
  EXPECT_THAT([&] { ImageSet::open(root() / "mug"); },
              ThrowsMessage<FileError>(HasSubstr("nested deeper than")));
  write(index, "{}");
  EXPECT_THAT([&] { ImageSet::open(root() / "mug"); },
              ThrowsMessage<FileError>(HasSubstr("\"format\" is missing")));
  EXPECT_THROW(ImageSet::open(root() / "nothing"), FileError);
}

TEST_F(ImageSetFiles, OpensNothingButPlainFiles) {
  make("mug", 1);
  for (const char* name : {"set.json", "views.jsonl"}) {
    const auto file = root() / "mug" / name;
    const std::string text = read(file);
    std::filesystem::remove(file);
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    EXPECT_THAT([&] { ImageSet::open(root() / "mug"); }, ThrowsMessage<FileError>(HasSubstr("is a pipe")));
    std::filesystem::remove(file);
    write(file, text);
  }
  std::filesystem::remove(root() / "mug/000000.png");
  ASSERT_EQ(::mkfifo((root() / "mug/000000.png").c_str(), 0600), 0);
  EXPECT_THAT([&] { (void)ImageSet::open(root() / "mug").load(0); },
              ThrowsMessage<FileError>(HasSubstr("is a pipe")));
}

TEST_F(ImageSetFiles, HaveOneWriterAtATime) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object());
  writer.add(picture(1), {0.0});
  EXPECT_THAT([&] { make("mug", 1); },
              ThrowsMessage<FileError>(HasSubstr("another program uses the image set")));
  make("cup", 1);
  writer.add(picture(2), {10.0});
  writer.finish();
  EXPECT_EQ(ImageSet::open(root() / "mug").views().size(), 2U);
}

TEST_F(ImageSetFiles, HoldNothingElseWhenTheyAreComplete) {
  std::filesystem::create_directory(root() / "mug");
  write(root() / "mug/.eigenpose-part-1-1", "what a killed program left");
  make("mug", 2);
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(root() / "mug"))
    names.push_back(entry.path().filename());
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("set.json", "views.jsonl", "000000.png", "000001.png"));
}

TEST_F(ImageSetFiles, TakeFactsAndSourcesThatAreNotUtf8) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), {{"imported_from", "/k\xe4"}});
  writer.add(picture(1), {0.0}, {{"imported_name", "k\xe4.png"}});
  writer.finish();
  EXPECT_THAT(read(root() / "mug/set.json"), HasSubstr("/k\xef\xbf\xbd")) << "U+FFFD stands for what is none";
  EXPECT_EQ(ImageSet::open(root() / "mug").views().size(), 1U);
}

TEST_F(ImageSetFiles, OneThatCannotBeUsedIsLeftOutAndNamed) {
  for (const char* name : {"cup", "duck", "mug", "pan", "pot"}) make(name, 1);
  write(root() / "duck/set.json", "damaged");
  std::filesystem::remove(root() / "mug/views.jsonl");
  std::filesystem::remove(root() / "pan/set.json");
  std::filesystem::create_directory(root() / "pan/set.json");
  std::filesystem::create_directory(root() / "not a set");
  const FoundImageSets found = find_image_sets(root());
  ASSERT_EQ(found.sets.size(), 2U);
  EXPECT_EQ(found.sets[0].object(), "cup");
  EXPECT_EQ(found.sets[1].object(), "pot");
  ASSERT_EQ(found.left_out.size(), 3U);
  EXPECT_EQ(found.left_out[0].file(), root() / "duck/set.json");
  EXPECT_EQ(found.left_out[1].file(), root() / "mug/views.jsonl");
  EXPECT_EQ(found.left_out[2].file(), root() / "pan/set.json");
  EXPECT_THAT([&] { open_image_sets(root()); }, ThrowsMessage<FileError>(HasSubstr("duck/set.json")));
}

TEST_F(ImageSetFiles, TwoOfOneObjectAreBothLeftOutAndNamed) {
  for (const char* name : {"cup", "mug", "pan"}) make(name, 1);
  for (const char* copy : {"a", "z"}) std::filesystem::copy(root() / "mug", root() / copy);
  const FoundImageSets found = find_image_sets(root());
  ASSERT_EQ(found.sets.size(), 2U);
  EXPECT_EQ(found.sets[0].object(), "cup");
  EXPECT_EQ(found.sets[1].object(), "pan");
  ASSERT_EQ(found.left_out.size(), 3U);
  EXPECT_THAT(found.left_out[0].what(), HasSubstr("are both of the object \"mug\""));
}

TEST_F(ImageSetFiles, SayWhyNoneOfThemCanBeUsed) {
  make("duck", 1);
  write(root() / "duck/set.json", "damaged");
  EXPECT_THAT([&] { find_image_sets(root()); },
              ThrowsMessage<FileError>(
                  AllOf(HasSubstr("no image set that can be used"), HasSubstr("duck/set.json: "))));
  EXPECT_THAT([&] { find_image_sets(root() / "duck"); },
              ThrowsMessage<FileError>(HasSubstr("this is not JSON")));
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
