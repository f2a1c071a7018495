#include "daemon/api/unix_socket.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;

std::string refusal(const std::filesystem::path& path, const std::string& group = "") {
  try {
    const UnixSocket socket(path, 0600, group);
  } catch (const FileError& error) {
    return error.what();
  }
  return "claimed";
}

/// Leaves a socket file behind that nobody listens on, as a killed program does.
void leave_stale_socket(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ::close(fd);
}

class UnixSocketTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "s.sock";
};

TEST_F(UnixSocketTest, RefusesAPathWhereSomebodyAnswersAndSaysWhatToDo) {
  const UnixSocket first(path_, 0600, "");
  EXPECT_THAT(refusal(path_), HasSubstr("another eigenposed answers on this socket: stop it first"));
  EXPECT_TRUE(std::filesystem::exists(path_)) << "the live one keeps its file";
}

TEST_F(UnixSocketTest, ReplacesAStaleSocket) {
  leave_stale_socket(path_);
  ASSERT_TRUE(std::filesystem::exists(path_));
  EXPECT_EQ(refusal(path_), "claimed");
}

TEST_F(UnixSocketTest, RefusesAFileThatIsNoSocketAndLeavesIt) {
  std::ofstream(path_) << "precious";
  EXPECT_THAT(refusal(path_), HasSubstr("is not a socket"));
  EXPECT_EQ(std::filesystem::file_size(path_), 8U);
}

TEST_F(UnixSocketTest, TakesItsFileAwayAtTheEnd) {
  { const UnixSocket socket(path_, 0600, ""); }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(UnixSocketTest, LeavesASuccessorsFileAlone) {
  {
    const UnixSocket socket(path_, 0600, "");
    std::filesystem::remove(path_);
    leave_stale_socket(path_);
  }
  EXPECT_TRUE(std::filesystem::exists(path_));
}

TEST_F(UnixSocketTest, SetsTheModeThatSaysWhoMayCome) {
  const UnixSocket socket(path_, 0640, "");
  struct stat status {};
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0640U);
}

TEST_F(UnixSocketTest, RefusesAnUnknownGroupAndLeavesNothing) {
  EXPECT_THAT(refusal(path_, "no-such-group"), HasSubstr("there is no group \"no-such-group\""));
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(UnixSocketTest, RefusesAPathThatIsTooLongForASocket) {
  EXPECT_THAT(refusal(folder_.path() / std::string(120, 'x')), HasSubstr("shorter runtime_dir"));
}

TEST_F(UnixSocketTest, RefusesAFolderThatIsNotThere) {
  EXPECT_THAT(refusal(folder_.path() / "no" / "s.sock"), HasSubstr("No such file"));
}

}  // namespace
}  // namespace eigenpose
