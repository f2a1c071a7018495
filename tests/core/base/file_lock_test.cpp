#include "core/base/file_lock.h"

#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;

class FileLockTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string refusal() const {
    try {
      const FileLock lock(file_, "the folder");
    } catch (const FileError& error) {
      return error.what();
    }
    return "locked";
  }

  test::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "lock";
};

TEST_F(FileLockTest, HasOneOwnerAtATime) {
  {
    const FileLock lock(file_, "the folder");
    EXPECT_THAT(refusal(), HasSubstr("another program uses the folder")) << "in this process";
    const pid_t child = ::fork();
    if (child == 0) ::_exit(refusal() == "locked" ? 1 : 0);
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0) << "in another process";
  }
  EXPECT_FALSE(std::filesystem::exists(file_)) << "nothing is left behind";
  EXPECT_EQ(refusal(), "locked") << "after the first has ended";
}

TEST_F(FileLockTest, EndsWithAProcessThatIsKilled) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const FileLock lock(file_, "the folder");
    (void)!::write(ready[1], "x", 1);
    for (;;) ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_NE(refusal(), "locked");
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(refusal(), "locked");
  ::close(ready[0]);
  ::close(ready[1]);
}

TEST_F(FileLockTest, SaysWhatItCannotLock) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT(refusal(), HasSubstr("not a plain file"));
  EXPECT_THROW(FileLock(folder_.path() / "missing" / "lock", "the folder"), FileError);
}

}  // namespace
}  // namespace eigenpose
