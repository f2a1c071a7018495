// What `eigenpose learn --update` takes, refuses and keeps.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/file_lock.h"
#include "core/dataset/image_set.h"
#include "tests/daemon/offline_commands.h"

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class UpdateCommand : public OfflineCommands {
 protected:
  void SetUp() override {
    write_objects();
    const Ended learned = eigenpose("learn sets --to a.model --size 32 --whole-region --keep-views");
    ASSERT_EQ(learned.code, 0) << learned.output;
  }
  [[nodiscard]] std::string bytes(const std::string& file) const {
    std::ifstream in(path(file), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
};

TEST_F(UpdateCommand, ChangesNothingWhereASetCannotJoin) {
  // Grey views cannot join a model of colour ones: the object they replace would be lost.
  ImageSetWriter writer(path("grey"), "duck", turntable_workspace(), json::object(), {});
  for (int i = 0; i < 12; ++i) {
    cv::Mat grey;
    cv::cvtColor(testing::scene_with(1, 30.0 * i), grey, cv::COLOR_BGR2GRAY);
    writer.add(grey, {30.0 * i});
  }
  writer.finish();
  const std::string model = bytes("a.model");
  const std::string views = bytes("a.model.views");
  const Ended run = eigenpose("learn grey --update a.model --remove duck");
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.output, AllOf(HasSubstr("\"duck\" cannot join"), HasSubstr("nothing was changed")));
  EXPECT_EQ(bytes("a.model"), model);
  EXPECT_EQ(bytes("a.model.views"), views);
}

TEST_F(UpdateCommand, GoesOnAfterAnInterruptionBetweenTheRenamesOfModelAndViews) {
  testing::write_turn(path("sets2"), "cup", 3, 18);
  testing::write_turn(path("sets3"), "car", 4, 18);
  const std::string former = bytes("a.model.views");
  ASSERT_EQ(eigenpose("learn sets2 --update a.model").code, 0);
  EXPECT_FALSE(std::filesystem::exists(path("a.model.views.next")));
  // As it stands after a crash behind the first of the two renames.
  std::filesystem::rename(path("a.model.views"), path("a.model.views.next"));
  std::ofstream(path("a.model.views"), std::ios::binary) << former;
  const Ended run = eigenpose("learn sets3 --update a.model");
  EXPECT_EQ(run.code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("learned 4 objects"));
  EXPECT_FALSE(std::filesystem::exists(path("a.model.views.next")));
  EXPECT_EQ(eigenpose("learn --update a.model --remove car").code, 0);
}

TEST_F(UpdateCommand, WritesNoModelOverKeptViews) {
  const std::string views = bytes("a.model.views");
  const Ended run = eigenpose("learn --update a.model --remove duck --to a.model.views");
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.output, HasSubstr("name of kept views"));
  EXPECT_EQ(bytes("a.model.views"), views);
}

TEST_F(UpdateCommand, RunsAloneOnItsModel) {
  const std::string model = bytes("a.model");
  {
    const FileLock other(path("a.model.lock"), "the model");
    const Ended run = eigenpose("learn --update a.model --remove duck");
    EXPECT_EQ(run.code, 1);
    EXPECT_THAT(run.output, HasSubstr("another program"));
  }
  EXPECT_EQ(bytes("a.model"), model);
  EXPECT_EQ(eigenpose("learn --update a.model --remove duck").code, 0);
  EXPECT_FALSE(std::filesystem::exists(path("a.model.lock")));
}

TEST_F(UpdateCommand, NamesEachFolderThatAModelWasLearnedFromOnce) {
  testing::write_turn(path("sets2"), "cup", 3, 18);
  ASSERT_EQ(eigenpose("learn sets2 --update a.model").code, 0);
  ASSERT_EQ(eigenpose("learn sets2 --update a.model --remove cup").code, 0);
  const json all = json::parse(eigenpose("inspect a.model --json").output);
  EXPECT_EQ(all["provenance"]["image_sets"], path("sets") + ", " + path("sets2"));
}

TEST_F(UpdateCommand, InspectShowsNoControlCharactersAndWritesJsonOfAnyFolder) {
  const std::string folder = "odd\xff\x1b[31m";
  std::filesystem::rename(path("sets"), path(folder));
  const Ended learned = eigenpose("learn '" + folder + "' --to b.model --size 32 --whole-region");
  ASSERT_EQ(learned.code, 0) << learned.output;
  EXPECT_THAT(eigenpose("inspect b.model").output, Not(HasSubstr("\x1b")));
  const Ended as_json = eigenpose("inspect b.model --json");
  ASSERT_EQ(as_json.code, 0) << as_json.output;
  EXPECT_THAT(json::parse(as_json.output)["provenance"]["image_sets"].get<std::string>(), HasSubstr("odd"));
}

TEST_F(UpdateCommand, LearnsThreeViewsOfATurnBesideOthers) {
  testing::write_turn(path("sets"), "three", 3, 3);
  for (const char* method : {"", " --whole-region"}) {
    const Ended learned = eigenpose("learn sets --to b.model --size 32" + std::string(method));
    EXPECT_EQ(learned.code, 0) << learned.output;
    EXPECT_THAT(learned.output, HasSubstr("learned 3 objects"));
  }
}

}  // namespace
}  // namespace eigenpose
