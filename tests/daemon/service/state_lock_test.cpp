#include "daemon/service/state_lock.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose::state_lock_test {
namespace {

using ::testing::HasSubstr;

std::string refusal(const std::filesystem::path& folder) {
  try {
    const StateLock lock(folder);
  } catch (const FileError& error) {
    return error.what();
  }
  return "granted";
}

TEST(StateLock, HasOneOwnerAtATimeAndNamesIt) {
  const test::TemporaryFolder folder;
  {
    const StateLock first(folder.path());
    EXPECT_THAT(refusal(folder.path()),
                AllOf(HasSubstr("another eigenposed (process " + std::to_string(::getpid()) + ")"),
                      HasSubstr("another state_dir")));
  }
  EXPECT_EQ(refusal(folder.path()), "granted") << "it is given back";
}

TEST(StateLock, OfTwoFoldersAreTwoLocks) {
  const test::TemporaryFolder one, other;
  const StateLock lock(one.path());
  EXPECT_EQ(refusal(other.path()), "granted");
}

TEST(StateLock, SaysWhyAFolderCannotBeLocked) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal(folder.path() / "no"), HasSubstr("No such file"));
}

}  // namespace
}  // namespace eigenpose::state_lock_test
