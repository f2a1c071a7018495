#include "core/base/atomic_file.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/full_disk.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Passes all calls on, writes down their names, and lets the call number `failing` (from 0) fail with
/// `error`.
class ScriptedCalls : public FileCalls {
 public:
  int open(const char* path, int flags, mode_t mode) override {
    return fails((flags & O_DIRECTORY) != 0 ? "open folder" : "open") ? -1
                                                                      : FileCalls::open(path, flags, mode);
  }
  ssize_t pwrite(int fd, const void* bytes, std::size_t count, off_t at) override {
    return fails("write") ? -1 : FileCalls::pwrite(fd, bytes, std::min(count, most_at_once), at);
  }
  int fsync(int fd) override {
    struct stat status {};
    ::fstat(fd, &status);
    return fails(S_ISDIR(status.st_mode) ? "sync folder" : "sync") ? -1 : FileCalls::fsync(fd);
  }
  int close(int fd) override {
    const bool failed = fails("close");
    FileCalls::close(fd);
    if (failed) errno = error;
    return failed ? -1 : 0;
  }
  int rename(const char* from, const char* to) override {
    return fails("rename") ? -1 : FileCalls::rename(from, to);
  }

  int failing = -1;
  int error = EIO;
  std::size_t most_at_once = 1'000'000;
  std::vector<std::string> made;

 private:
  bool fails(const char* name) {
    made.emplace_back(name);
    errno = error;
    return failing == static_cast<int>(made.size()) - 1;
  }
};

class AtomicFileTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_))
      names.push_back(entry.path().filename().string());
    return names;
  }
  static std::string refusal(const std::function<void()>& work) {
    try {
      work();
    } catch (const FileError& error) {
      return error.what();
    }
    return "done";
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  fs::path file_ = folder_ / "a.txt";
};

TEST_F(AtomicFileTest, ReplacesTheWholeContent) {
  write_file_atomically(file_, "a long first content");
  write_file_atomically(file_, "short");
  EXPECT_EQ(read(file_), "short");
  EXPECT_THAT(files(), ElementsAre("a.txt"));
}

TEST_F(AtomicFileTest, LeavesTheTargetAloneWithoutCommit) {
  write_file_atomically(file_, "kept");
  {
    AtomicFile unfinished(file_);
    unfinished.write("half");
  }
  EXPECT_EQ(read(file_), "kept");
  EXPECT_THAT(files(), ElementsAre("a.txt"));
}

TEST_F(AtomicFileTest, WritesAnywhereAndReadsItBack) {
  {
    AtomicFile file(file_);
    file.write("abc");
    file.write_at(6, "xyz");
    file.write("!");
    file.write_at(1, "B");
    EXPECT_EQ(file.size(), 10U);
    std::vector<std::uint8_t> bytes(20);
    EXPECT_EQ(file.read_at(6, bytes), 4U);
    EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 4), "xyz!");
    file.resize(9);
    file.commit();
  }
  EXPECT_EQ(read(file_), std::string("aBc\0\0\0xyz", 9));
}

TEST_F(AtomicFileTest, FlushesTheFileBeforeItIsRenamedAndTheFolderAfter) {
  ScriptedCalls calls;
  write_file_atomically(file_, "x", calls);
  EXPECT_THAT(calls.made,
              ElementsAre("open", "write", "sync", "open folder", "close", "rename", "sync folder", "close"));
}

TEST_F(AtomicFileTest, WritesOnAfterAShortWrite) {
  ScriptedCalls calls;
  calls.most_at_once = 3;
  write_file_atomically(file_, "0123456789", calls);
  EXPECT_EQ(read(file_), "0123456789");
}

TEST_F(AtomicFileTest, GoesOnAfterAnInterruptedWrite) {
  ScriptedCalls calls;
  calls.failing = 1;
  calls.error = EINTR;
  write_file_atomically(file_, "whole", calls);
  EXPECT_EQ(read(file_), "whole");
}

TEST_F(AtomicFileTest, EveryCallThatFailsIsAnErrorAndKeepsTheFormerFile) {
  for (int failing = 0; failing < 6; ++failing) {
    write_file_atomically(file_, "former");
    ScriptedCalls calls;
    calls.failing = failing;
    const std::string said = refusal([&] { write_file_atomically(file_, "new", calls); });
    EXPECT_THAT(said, AllOf(StartsWith(file_.string()), HasSubstr("Input/output error"),
                            HasSubstr("the former file is unchanged")))
        << calls.made.back();
    EXPECT_EQ(read(file_), "former") << calls.made.back();
    EXPECT_THAT(files(), ElementsAre("a.txt")) << calls.made.back();
  }
}

TEST_F(AtomicFileTest, SaysThatTheNewFileIsThereWhenItsFolderCannotBeFlushed) {
  for (const int failing : {6, 7}) {
    write_file_atomically(file_, "former");
    ScriptedCalls calls;
    calls.failing = failing;
    EXPECT_THAT(
        refusal([&] { write_file_atomically(file_, "new", calls); }),
        AllOf(HasSubstr("is written, but its folder cannot be flushed"), Not(HasSubstr("unchanged"))));
    EXPECT_EQ(read(file_), "new");
  }
}

TEST_F(AtomicFileTest, AFileSystemThatFlushesNoFoldersIsGoodEnough) {
  ScriptedCalls calls;
  calls.failing = 6;
  calls.error = EINVAL;
  write_file_atomically(file_, "new", calls);
  EXPECT_EQ(read(file_), "new");
}

TEST_F(AtomicFileTest, AFullDiskIsAnErrorAndLosesNothing) {
  write_file_atomically(file_, "kept");
  const std::string said = [&] {
    const test::FullDisk disk(1024);
    return refusal([&] { write_file_atomically(file_, std::string(100'000, 'x')); });
  }();
  EXPECT_THAT(said, AllOf(HasSubstr("a.txt"), HasSubstr("the former file is unchanged")));
  EXPECT_EQ(read(file_), "kept");
  EXPECT_THAT(files(), ElementsAre("a.txt"));
}

TEST_F(AtomicFileTest, CallsAFullDiskBySuchAName) {
  ScriptedCalls calls;
  calls.failing = 1;
  calls.error = ENOSPC;
  EXPECT_THAT(refusal([&] { write_file_atomically(file_, "x", calls); }), HasSubstr("the disk is full"));
}

TEST_F(AtomicFileTest, ReplacesOnlyWhatWasVerified) {
  write_file_atomically(file_, "former");
  std::string seen;
  {
    AtomicFile file(file_);
    file.write("new");
    const auto refuse = [&](const fs::path& part) {
      seen = read(part);
      throw FileError(part, "is damaged");
    };
    EXPECT_THAT(refusal([&] { file.commit(refuse); }),
                AllOf(StartsWith(file_.string() + ": read back after writing, it is damaged"),
                      HasSubstr("the former file is unchanged")));
  }
  EXPECT_EQ(seen, "new");
  EXPECT_EQ(read(file_), "former");
  EXPECT_THAT(files(), ElementsAre("a.txt"));
}

TEST_F(AtomicFileTest, VerifiesWhatIsOnTheDiskAlready) {
  ScriptedCalls calls;
  AtomicFile file(file_, calls);
  file.write("new");
  file.commit([&](const fs::path&) { calls.made.emplace_back("verify"); });
  EXPECT_THAT(calls.made, ElementsAre("open", "write", "sync", "verify", "open folder", "close", "rename",
                                      "sync folder", "close"));
}

TEST_F(AtomicFileTest, WhatIsPreparedIsOnlyRenamedLater) {
  ScriptedCalls calls;
  AtomicFile file(file_, calls);
  file.write("new");
  int verified = 0;
  file.prepare([&](const fs::path&) { ++verified; });
  EXPECT_FALSE(fs::exists(file_));
  calls.made.clear();
  file.commit();
  EXPECT_THAT(calls.made, ElementsAre("open folder", "close", "rename", "sync folder", "close"));
  EXPECT_EQ(verified, 1);
  EXPECT_EQ(read(file_), "new");
}

TEST_F(AtomicFileTest, WhatIsStagedOutlivesItsProgramAndReplacesNothingBeforeItIsCommitted) {
  write_file_atomically(file_, "former");
  EXPECT_EQ(AtomicFile::staged_name(file_), folder_ / "a.txt.next");
  {
    ScriptedCalls calls;
    AtomicFile file(file_, calls);
    file.write("new");
    file.stage();
    EXPECT_THAT(calls.made, ElementsAre("open", "write", "sync", "open folder", "close", "rename",
                                        "sync folder", "close"));
    EXPECT_EQ(file.part(), folder_ / "a.txt.next");
    EXPECT_EQ(read(file_), "former");
  }
  EXPECT_EQ(read(folder_ / "a.txt.next"), "new");
  ScriptedCalls calls;
  AtomicFile file(file_, calls);
  file.write("newer");
  file.stage();
  calls.made.clear();
  file.commit();
  EXPECT_THAT(calls.made, ElementsAre("open folder", "rename", "sync folder", "close"));
  EXPECT_EQ(read(file_), "newer");
  EXPECT_THAT(files(), ElementsAre("a.txt"));
}

TEST_F(AtomicFileTest, IsStagedBesideTheFileThatALinkNames) {
  fs::create_directory(folder_ / "far");
  write_file_atomically(folder_ / "far" / "b.txt", "former");
  fs::create_symlink("far/b.txt", file_);
  EXPECT_EQ(AtomicFile::staged_name(file_), folder_ / "far" / "b.txt.next");
  AtomicFile file(file_);
  file.write("new");
  file.stage();
  EXPECT_EQ(read(folder_ / "far" / "b.txt.next"), "new");
  file.commit();
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_EQ(read(folder_ / "far" / "b.txt"), "new");
}

TEST_F(AtomicFileTest, EveryCallOfStagingThatFailsIsAnErrorAndKeepsTheFormerFile) {
  write_file_atomically(file_, "former");
  const int calls_to_stage = 8;
  for (int failing = 0; failing < calls_to_stage; ++failing) {
    ScriptedCalls calls;
    calls.failing = failing;
    EXPECT_NE(refusal([&] {
                AtomicFile file(file_, calls);
                file.write("new");
                file.stage();
              }),
              "done")
        << failing;
    EXPECT_EQ(read(file_), "former") << failing;
  }
}

/// Longer than any file system takes: asking whether it is there fails as in a folder that may not be
/// searched, also for root.
TEST_F(AtomicFileTest, ANameThatCannotEvenBeLookedUpIsAFileError) {
  const fs::path unfindable = folder_ / std::string(300, 'x');
  EXPECT_THAT(refusal([&] { write_file_atomically(unfindable, "new"); }), HasSubstr("cannot be replaced"));
  EXPECT_THAT(refusal([&] { write_file_atomically(unfindable / "a.txt", "new"); }),
              HasSubstr("cannot be written"));
  EXPECT_THAT(refusal([&] { make_folders(unfindable); }), HasSubstr("cannot be made"));
  EXPECT_THAT(files(), ElementsAre());
}

TEST_F(AtomicFileTest, FlushesLaterOnlyWhereThatIsAskedFor) {
  write_file_unflushed(file_, "new");
  EXPECT_EQ(read(file_), "new");
  ScriptedCalls calls;
  AtomicFile file(file_, calls);
  file.write("newer");
  file.commit_unflushed();
  EXPECT_THAT(calls.made, ElementsAre("open", "write", "close", "rename"));
  EXPECT_EQ(read(file_), "newer");
  EXPECT_NO_THROW(flush_file_system(folder_));
  EXPECT_THROW(flush_file_system(folder_ / "missing"), FileError);
}

TEST_F(AtomicFileTest, MakesFoldersThatAreMissing) {
  make_folders(folder_ / "a" / "b");
  make_folders(folder_ / "a" / "b");
  EXPECT_TRUE(fs::is_directory(folder_ / "a" / "b"));
  write_file_atomically(file_, "x");
  EXPECT_THAT(refusal([&] { make_folders(file_ / "b"); }), HasSubstr("a.txt: cannot be made"));
}

TEST_F(AtomicFileTest, NamesTheFileItCannotWrite) {
  EXPECT_THAT(refusal([&] { write_file_atomically(folder_ / "missing" / "a.txt", "x"); }),
              AllOf(HasSubstr("missing/a.txt"), HasSubstr("No such file or directory")));
}

TEST_F(AtomicFileTest, ReplacesTheFileThatALinkNames) {
  fs::create_directory(folder_ / "large");
  write_file_atomically(folder_ / "large" / "a.txt", "former");
  fs::create_symlink("large/a.txt", file_);
  write_file_atomically(file_, "new");
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_EQ(read(folder_ / "large" / "a.txt"), "new");
  fs::create_symlink("b.txt", folder_ / "b.txt");
  EXPECT_THAT(refusal([&] { write_file_atomically(folder_ / "b.txt", "x"); }), HasSubstr("leads nowhere"));
}

TEST_F(AtomicFileTest, ReplacesNothingButPlainFiles) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT(refusal([&] { write_file_atomically(file_, "x"); }), HasSubstr("not a plain file"));
  EXPECT_TRUE(fs::is_fifo(file_));
  EXPECT_THAT(refusal([&] { write_file_atomically(folder_, "x"); }), HasSubstr("is a folder"));
  EXPECT_THAT(refusal([&] { write_file_atomically("/dev/full", "x"); }), HasSubstr("not a plain file"));
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(AtomicFileTest, TakesAnyNameThatTheFileSystemTakes) {
  const fs::path longest = folder_ / std::string(255, 'n');
  write_file_atomically(longest, "x");
  EXPECT_EQ(read(longest), "x");
}

TEST_F(AtomicFileTest, ANameThatAKilledProgramLeftIsNoObstacle) {
  fs::path next;
  {
    const AtomicFile unfinished(file_);
    const std::string name = unfinished.part().string();
    const auto digits = name.rfind('-') + 1;
    next = name.substr(0, digits) + std::to_string(std::stoi(name.substr(digits)) + 1);
  }
  std::ofstream(next) << "left";
  write_file_atomically(file_, "new");
  EXPECT_EQ(read(file_), "new");
  EXPECT_EQ(read(next), "left");
}

TEST_F(AtomicFileTest, AFinishedPartIsNoAbandonedOneBeforeItHasItsName) {
  class Meanwhile : public FileCalls {
   public:
    int rename(const char* from, const char* to) override {
      remove_abandoned_parts(fs::path(from).parent_path());
      return FileCalls::rename(from, to);
    }
  } calls;
  write_file_atomically(file_, "new", calls);
  EXPECT_EQ(read(file_), "new");
}

TEST_F(AtomicFileTest, PartsOfKilledProgramsAreRemovedAndThoseOfRunningOnesKept) {
  AtomicFile running(file_);
  running.write("new");
  std::ofstream(folder_ / ".eigenpose-part-1-1") << "left";
  std::ofstream(folder_ / "other.txt") << "other";
  remove_abandoned_parts(folder_);
  EXPECT_THAT(files(), ::testing::UnorderedElementsAre(running.part().filename().string(), "other.txt"));
  running.commit();
  EXPECT_EQ(read(file_), "new");
  remove_abandoned_parts(folder_ / "missing");
}

}  // namespace
}  // namespace eigenpose
