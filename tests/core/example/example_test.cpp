// The example that README shows, run as a user runs it.

#include <array>
#include <cstdio>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <sys/wait.h>

#include "core/image/picture_file.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;

struct Ended {
  int code = -1;
  std::string output;
};

Ended run(const std::string& arguments) {
  Ended result;
  std::string command = EXAMPLE;
  command.append(" ").append(arguments).append(" 2>&1");
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return result;
  std::array<char, 512> text{};
  while (std::fgets(text.data(), text.size(), pipe) != nullptr) result.output += text.data();
  const int status = ::pclose(pipe);
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return result;
}

TEST(Example, LearnsAndRecognizesWithTheLibraryAlone) {
  const test::TemporaryFolder folder;
  const auto sets = folder.path() / "sets";
  testing::write_turn(sets, "duck", 1, 24);
  testing::write_turn(sets, "mug", 2, 24);
  const auto picture = folder.path() / "picture.png";
  const auto png = encode_png(testing::scene_with(2, 120.0));
  std::ofstream(picture, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  const Ended done = run("'" + sets.string() + "' '" + (folder.path() / "a.model").string() + "' '" +
                         picture.string() + "'");
  ASSERT_EQ(done.code, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("learned 2 objects from 48 views"));
  EXPECT_THAT(done.output, HasSubstr("recognized mug, turned by 1")) << "120 degrees, give or take 10";
}

TEST(Example, SaysWhatIsWrong) {
  EXPECT_EQ(run("").code, 2);
  const Ended failed = run("/nonexistent /tmp/never.model");
  EXPECT_EQ(failed.code, 1);
  EXPECT_THAT(failed.output, HasSubstr("/nonexistent"));
}

}  // namespace
}  // namespace eigenpose
