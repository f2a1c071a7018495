#include "core/base/atomic_file.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public testing::Test {
 protected:
  static std::string read(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::stringstream text;
    text << in.rdbuf();
    return text.str();
  }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

TEST_F(AtomicFileTest, ReplacesTheWholeContent) {
  const fs::path file = folder_ / "a.txt";
  write_file_atomically(file, "a long first content");
  write_file_atomically(file, "short");
  EXPECT_EQ(read(file), "short");
  EXPECT_EQ(files(), 1U) << "a part file was left behind";
}

TEST_F(AtomicFileTest, LeavesTheTargetAloneWithoutCommit) {
  const fs::path file = folder_ / "a.txt";
  write_file_atomically(file, "kept");
  {
    const AtomicFile unfinished(file);
    std::ofstream(unfinished.part()) << "half";
  }
  EXPECT_EQ(read(file), "kept");
  EXPECT_EQ(files(), 1U);
}

TEST_F(AtomicFileTest, AFullDiskIsAnErrorAndLosesNothing) {
  const fs::path file = folder_ / "a.txt";
  write_file_atomically(file, "kept");
  // A file size limit stands in for the full disk: write() fails the same way.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tiny{1024, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &tiny), 0);
  EXPECT_THROW(write_file_atomically(file, std::string(100'000, 'x')), FileError);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_EQ(read(file), "kept");
  EXPECT_EQ(files(), 1U);
}

TEST_F(AtomicFileTest, NamesTheFileItCannotWrite) {
  try {
    write_file_atomically(folder_ / "missing" / "a.txt", "x");
    FAIL() << "writing into a missing folder succeeded";
  } catch (const FileError& error) {
    EXPECT_NE(std::string(error.what()).find("a.txt"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace eigenpose
