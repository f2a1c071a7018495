#include "drivers/device_claim.h"

#include <filesystem>
#include <fstream>
#include <string>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

constexpr uid_t nobody = 65534;

class DeviceClaims : public testing::Test {
 protected:
  DeviceClaims() {
    fs::create_directory(shared_);
    fs::create_directory(home_);
    fs::permissions(shared_, fs::perms::owner_all);
    fs::permissions(home_, fs::perms::owner_all);
  }
  [[nodiscard]] ClaimPlaces places() const { return {shared_, "eigenpose", {home_}}; }
  /// Runs `work` as another user in a process of its own. @return what it returned.
  static int as_nobody(const std::function<int()>& work) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(::setgid(nobody) == 0 && ::setuid(nobody) == 0 ? work() : 99);
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 98;
  }
  /// Any user may look into the folders above.
  void open_to_all() const {
    fs::permissions(folder_.path(), fs::perms::owner_all | fs::perms::group_exec | fs::perms::others_exec |
                                        fs::perms::others_read);
  }

  test::TemporaryFolder folder_;
  fs::path shared_ = folder_.path() / "shared";
  fs::path home_ = folder_.path() / "home";
};

TEST_F(DeviceClaims, ADeviceIsClaimedOnceUntilItIsLetGo) {
  auto first = DeviceClaim::make("tcp 10.0.0.1:502 unit 1", places());
  ASSERT_TRUE(first.has_value());
  EXPECT_FALSE(DeviceClaim::make("tcp 10.0.0.1:502 unit 1", places()).has_value());
  EXPECT_TRUE(DeviceClaim::make("tcp 10.0.0.1:502 unit 2", places()).has_value()) << "another device";
  EXPECT_TRUE(DeviceClaim::make("tcp 10.0.0.1:5021 unit 1", places()).has_value()) << "another gateway";
  first.reset();
  EXPECT_TRUE(DeviceClaim::make("tcp 10.0.0.1:502 unit 1", places()).has_value());
}

TEST_F(DeviceClaims, NamesThatDifferInAnySignAreOtherDevices) {
  const auto first = DeviceClaim::make("a/b", places());
  EXPECT_TRUE(DeviceClaim::make("a_b", places()).has_value());
  EXPECT_TRUE(DeviceClaim::make("a%2Fb", places()).has_value());
  const std::string long_name(400, 'x');
  const auto long_claim = DeviceClaim::make(long_name + "1", places());
  EXPECT_TRUE(long_claim.has_value());
  EXPECT_TRUE(DeviceClaim::make(long_name + "2", places()).has_value());
  EXPECT_FALSE(DeviceClaim::make(long_name + "1", places()).has_value());
}

TEST_F(DeviceClaims, AMovedClaimIsStillHeld) {
  auto first = DeviceClaim::make("drive", places());
  ASSERT_TRUE(first.has_value());
  const DeviceClaim moved = std::move(*first);
  first.reset();
  EXPECT_FALSE(DeviceClaim::make("drive", places()).has_value());
  EXPECT_EQ(moved.name(), "drive");
}

TEST_F(DeviceClaims, AProgramThatIsKilledHoldsNothing) {
  const pid_t child = ::fork();
  if (child == 0) {
    const auto claim = DeviceClaim::make("drive", places());
    ::raise(SIGKILL);
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(DeviceClaim::make("drive", places()).has_value());
}

TEST_F(DeviceClaims, TheMachinesFolderGoesBeforeTheUsersOwn) {
  EXPECT_EQ(claims_folder(places()), shared_);
  fs::remove(shared_);
  const fs::path own = claims_folder(places());
  EXPECT_EQ(own.parent_path(), home_);
  EXPECT_EQ(fs::status(own).permissions(), fs::perms::owner_all);
  EXPECT_EQ(claims_folder(places()), own) << "made once";
}

TEST_F(DeviceClaims, AFolderThatAnybodyMayWriteToIsNotTrusted) {
  fs::permissions(shared_, fs::perms::all);
  const fs::path own = claims_folder(places());
  EXPECT_EQ(own.parent_path(), home_);
  fs::remove(own);
  fs::permissions(home_, fs::perms::all);
  EXPECT_THROW((void)claims_folder(places()), Error);
}

TEST_F(DeviceClaims, ALinkIsNoFolderAndNoFile) {
  fs::remove(shared_);
  fs::create_directory_symlink(home_, shared_);
  const fs::path own = claims_folder(places());
  EXPECT_EQ(own.parent_path(), home_);
  fs::create_symlink(folder_.path() / "victim", own / "claim-drive");
  EXPECT_THROW((void)DeviceClaim::make("drive", places()), Error);
  EXPECT_FALSE(fs::exists(folder_.path() / "victim"));
}

TEST_F(DeviceClaims, WithoutAnyFolderTheErrorSaysWhatToInstall) {
  try {
    (void)DeviceClaim::make("drive", {folder_.path() / "none", "eigenpose", {folder_.path() / "neither"}});
    FAIL() << "claimed nowhere";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("eigenpose.tmpfiles"));
  }
}

TEST_F(DeviceClaims, NoOtherUserCanKeepADeviceFromItsService) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become another user: nobody else has tried to claim";
  open_to_all();
  { const auto former = DeviceClaim::make("drive", places()); }  // leaves its file
  const fs::path file = shared_ / "claim-drive";
  ASSERT_TRUE(fs::exists(file));
  // Another user tries what he can, and holds on to it until we have tried ours.
  int ready[2];
  int done[2];
  ASSERT_EQ(::pipe(ready), 0);
  ASSERT_EQ(::pipe(done), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    if (::setgid(nobody) != 0 || ::setuid(nobody) != 0) ::_exit(99);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string label = "eigenpose device drive";
    label.copy(address.sun_path + 1, label.size());
    const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
    (void)::bind(socket, reinterpret_cast<const sockaddr*>(&address),
                 static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + label.size()));
    const int opened = ::open(file.c_str(), O_RDONLY);
    const bool locked = opened >= 0 && ::flock(opened, LOCK_EX | LOCK_NB) == 0;
    (void)!::write(ready[1], "x", 1);
    char byte = 0;
    (void)!::read(done[0], &byte, 1);
    ::_exit(locked ? 1 : 0);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  EXPECT_TRUE(DeviceClaim::make("drive", places()).has_value());
  ASSERT_EQ(::write(done[1], "x", 1), 1);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0) << "another user could lock the file";
}

TEST_F(DeviceClaims, AnotherUsersFolderIsNotTaken) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder away: a foreign folder was not tried";
  ASSERT_EQ(::chown(shared_.c_str(), nobody, nobody), 0);
  EXPECT_EQ(claims_folder(places()).parent_path(), home_);
}

TEST_F(DeviceClaims, RootAndTheServiceExcludeEachOtherInTheMachinesFolder) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become the service's user: the two were not tried";
  open_to_all();
  ClaimPlaces machine = places();
  machine.service_user = "nobody";
  ASSERT_EQ(::chown(shared_.c_str(), nobody, nobody), 0);
  fs::permissions(shared_, fs::perms::owner_all | fs::perms::group_all);
  const auto held = [&] { return DeviceClaim::make("drive", machine).has_value() ? 1 : 0; };
  {
    const auto root = DeviceClaim::make("drive", machine);
    ASSERT_TRUE(root.has_value());
    EXPECT_EQ(as_nobody(held), 0) << "root drives it";
  }
  EXPECT_EQ(as_nobody(held), 1) << "root's file is the service's too";
}

}  // namespace
}  // namespace eigenpose
