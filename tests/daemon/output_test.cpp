// What `eigenpose` does where it cannot write: a full disk, a full or closed standard output, a reader that
// has gone; and where it cannot read: names, pipes, one picture of many.

#include <fstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/atomic_file.h"
#include "core/dataset/image_set.h"
#include "core/image/picture_file.h"
#include "tests/daemon/shell.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class Output : public ::testing::Test {
 protected:
  /// Two learned objects, their model and a picture, made once.
  static void SetUpTestSuite() {
    made_ = new test::TemporaryFolder;
    testing::write_turn(made_->path() / "sets", "duck", 1, 12);
    testing::write_turn(made_->path() / "sets", "mug", 2, 12);
    const auto png = encode_png(testing::scene_with(2, 120.0));
    write_file_atomically(made_->path() / "mug.png", {reinterpret_cast<const char*>(png.data()), png.size()});
    ASSERT_EQ(shell("cd '" + made_->path().string() + "' && '" EIGENPOSE "' " + learn("a.model")).code, 0);
  }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }

  static std::string learn(const std::string& file) {
    return "learn sets --to " + file + " --size 32 --whole-region --keep-views";
  }
  [[nodiscard]] static std::string path(const std::string& name) { return (made_->path() / name).string(); }
  /// @param before what the shell does first; @param after what follows the program's arguments:
  /// redirections.
  static Ended run(const std::string& arguments, const std::string& after = "",
                   const std::string& before = "true") {
    return shell("cd '" + made_->path().string() + "' && " + before + " && '" EIGENPOSE "' " + arguments +
                 after);
  }
  static void expect_one_line(const Ended& ended, const std::string& command) {
    EXPECT_EQ(ended.code, 1) << command << ended.output;
    EXPECT_THAT(ended.output, StartsWith("eigenpose: ")) << command;
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << command << ended.output;
  }
  static std::vector<std::string> printing_commands() {
    return {"--help",
            "--version",
            "learn --help",
            "inspect a.model",
            "inspect a.model --json",
            "recognize mug.png --model a.model",
            "recognize mug.png --model a.model --json",
            "resample a.model --to b.h5",
            learn("b.model"),
            "evaluate sets --size 32 --whole-region 2>/dev/null",
            "evaluate sets --size 32 --whole-region --json",
            "devices",
            "doctor"};
  }

  static test::TemporaryFolder* made_;
};
test::TemporaryFolder* Output::made_ = nullptr;

TEST_F(Output, AFullOneIsAnErrorOfEveryCommand) {
  for (const std::string& command : printing_commands()) {
    if (command.find("2>") != std::string::npos) {
      EXPECT_EQ(run(command, " >/dev/full").code, 1) << command;
      continue;
    }
    const Ended ended = run(command, " >/dev/full");
    EXPECT_EQ(ended.code, 1) << command;
    EXPECT_THAT(ended.output, HasSubstr("eigenpose: the output cannot be written")) << command;
  }
}

TEST_F(Output, AReaderThatHasGoneIsAnErrorAndNoSignal) {
  for (const std::string& command : printing_commands()) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    ::close(ends[0]);
    const Ended ended = run(command, " >&" + std::to_string(ends[1]));
    ::close(ends[1]);
    EXPECT_EQ(ended.code, 1) << command;
    if (command.find("2>") != std::string::npos) continue;
    EXPECT_THAT(ended.output, HasSubstr("eigenpose: the output cannot be written")) << command;
  }
}

TEST_F(Output, AClosedOneIsAnErrorAndIsPrintedIntoNoFile) {
  const Ended ended = run(learn("closed.model"), " >&-");
  expect_one_line(ended, "learn");
  EXPECT_THAT(ended.output, HasSubstr("Bad file descriptor"));
  EXPECT_EQ(run("inspect closed.model").code, 0) << "the model itself is whole";
  EXPECT_EQ(run(learn("closed.model"), " >&- 2>&- <&-").code, 1);
  EXPECT_EQ(run("inspect closed.model").code, 0);
}

TEST_F(Output, AFullDiskIsOneErrorWhereverItFillsAndKeepsTheFormerFile) {
  const std::vector<std::pair<std::string, std::string>> commands = {
      {learn("kept.model"), "kept.model"},
      {"resample a.model --to kept.h5", "kept.h5"},
      {"resample a.model --objects mug --to kept.csv", "kept.csv"},
      {"learn --update kept.model --remove duck", "kept.model"},
  };
  for (const auto& [command, file] : commands) {
    ASSERT_EQ(run(command.find("--update") != std::string::npos ? learn("kept.model") : command).code, 0)
        << command;
    const auto former = read_file(path(file));
    const std::size_t blocks = former.size() / 512;  // what `ulimit -f` of the shell counts
    for (const std::size_t limit : {std::size_t{0}, std::size_t{1}, std::size_t{4}, blocks / 3, blocks / 2}) {
      const Ended ended = run(command, " >/dev/null", "ulimit -f " + std::to_string(limit));
      expect_one_line(ended, command + " with " + std::to_string(limit) + " blocks: ");
      EXPECT_THAT(ended.output, HasSubstr("cannot be written")) << command;
      EXPECT_EQ(read_file(path(file)), former) << command;
    }
  }
}

TEST_F(Output, AFolderThatIsNotThereIsSaidBeforeAnythingIsLearned) {
  const Ended ended = run(learn("missing/a.model"));
  expect_one_line(ended, "learn");
  EXPECT_THAT(ended.output, HasSubstr("missing/a.model: cannot be written: No such file or directory"));
  expect_one_line(run("resample a.model --to missing/a.h5"), "resample");
  const Ended device = run(learn("/dev/full"));
  expect_one_line(device, "learn");
  EXPECT_THAT(device.output, HasSubstr("not a plain file"));
}

TEST_F(Output, EachPictureOfManyGetsItsAnswerOrItsError) {
  std::ofstream(path("broken.jpg")) << "no picture";
  const Ended shown = run("recognize mug.png broken.jpg missing.png mug.png --model a.model");
  EXPECT_EQ(shown.code, 1);
  const auto first = shown.output.find("mug.png\n");
  const auto broken = shown.output.find("eigenpose: broken.jpg: ");
  const auto missing = shown.output.find("eigenpose: missing.png: is not there");
  const auto last = shown.output.rfind("mug.png\n");
  EXPECT_EQ(first, 0U) << shown.output;
  EXPECT_LT(broken, missing) << shown.output;
  EXPECT_LT(missing, last) << shown.output;

  const Ended listed = run("recognize mug.png broken.jpg mug.png --model a.model --json", " 2>/dev/null");
  EXPECT_EQ(listed.code, 1);
  const json all = json::parse(listed.output);
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(all[0]["outcomes"][0]["object"], "mug");
  EXPECT_EQ(all[1]["image"], "broken.jpg");
  EXPECT_THAT(all[1]["error"].get<std::string>(), StartsWith("broken.jpg: "));
  EXPECT_FALSE(all[1].contains("outcomes"));
  EXPECT_EQ(all[2], all[0]);
  EXPECT_EQ(run("recognize mug.png mug.png --model a.model").code, 0);
}

TEST_F(Output, NamesThatAreNotUtf8AreAnswered) {
  const std::string name = "k\xe4\nlevel=error\x1b[2J.png";
  std::filesystem::copy_file(path("mug.png"), path(name));
  const std::string quoted = "'" + name + "'";
  const Ended text = run("recognize " + quoted + " --model a.model");
  EXPECT_EQ(text.code, 0) << text.output;
  EXPECT_THAT(text.output, StartsWith("k\\xe4\\nlevel=error\\x1b[2J.png\n"));
  const Ended listed = run("recognize " + quoted + " mug.png --model a.model --json");
  EXPECT_EQ(listed.code, 0);
  const json all = json::parse(listed.output);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0]["image"], "k\uFFFD\nlevel=error\x1b[2J.png");
  EXPECT_EQ(all[0]["outcomes"], all[1]["outcomes"]);
  expect_one_line(run("inspect 'a\nb\x1b.model'"), "inspect");
}

TEST_F(Output, NothingWaitsForAPipe) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::string command :
       {"inspect pipe", "recognize pipe --model a.model", "recognize mug.png --model pipe",
        "import turned pipe --to sets2", "learn --update pipe --remove mug"}) {
    const Ended ended = run(command);
    expect_one_line(ended, command);
    EXPECT_THAT(ended.output, AnyOf(HasSubstr("pipe: is a pipe; give a plain file"),
                                    HasSubstr("pipe: is not a plain file")))
        << command;
  }
}

TEST_F(Output, OptionsThatChooseNothingAreRefused) {
  EXPECT_THAT(run("learn --update a.model --remove mug --objects duck --to b.model").output,
              HasSubstr("--objects: "));
  EXPECT_THAT(run("resample a.model --objects mug,mug --to b.h5").output,
              HasSubstr("\"mug\" is named twice"));
  const Ended count = run("results --count 3");
  EXPECT_EQ(count.code, 2);
  EXPECT_THAT(count.output, HasSubstr("--follow"));
}

TEST_F(Output, ASetThatCannotBeUsedIsLeftOutAndNamed) {
  std::filesystem::copy(path("sets"), path("mixed"), std::filesystem::copy_options::recursive);
  std::filesystem::create_directory(path("mixed/pan"));
  std::ofstream(path("mixed/pan/set.json")) << std::string(90'000, '[');
  const Ended ended = run("learn mixed --to mixed.model --size 32 --whole-region");
  EXPECT_EQ(ended.code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("mixed/pan/set.json: "));
  const json model = json::parse(run("inspect mixed.model --json").output);
  EXPECT_EQ(model["objects"].size(), 2U);
}

}  // namespace
}  // namespace eigenpose
