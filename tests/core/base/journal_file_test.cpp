#include "core/base/journal_file.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A disk that has room for so many bytes, and takes so many at once.
class SmallDisk : public FileCalls {
 public:
  ssize_t pwrite(int fd, const void* bytes, std::size_t count, off_t at) override {
    if (room == 0) {
      errno = ENOSPC;
      return -1;
    }
    const ssize_t n = FileCalls::pwrite(fd, bytes, std::min(count, std::min(room, at_once)), at);
    room -= static_cast<std::size_t>(n);
    return n;
  }
  int fsync(int fd) override {
    ++syncs;
    errno = EIO;
    return sync_fails ? -1 : FileCalls::fsync(fd);
  }
  int ftruncate(int fd, off_t size) override {
    errno = EIO;
    return cut_fails ? -1 : FileCalls::ftruncate(fd, size);
  }
  bool cut_fails = false;
  std::size_t room = 1000;
  std::size_t at_once = 1000;
  int syncs = 0;
  bool sync_fails = false;
};

class JournalFileTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string text() const {
    const auto bytes = read_file(file_);
    return {bytes.begin(), bytes.end()};
  }
  test::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "a.jsonl";
};

TEST_F(JournalFileTest, GrowsLineByLine) {
  {
    JournalFile journal(file_, 0);
    EXPECT_EQ(text(), "") << "it is there before the first line";
    journal.append("one\n");
    journal.append("two\n");
    EXPECT_EQ(journal.size(), 8U);
  }
  JournalFile journal(file_, 8);
  journal.append("three\n");
  EXPECT_EQ(text(), "one\ntwo\nthree\n");
}

TEST_F(JournalFileTest, CutsOffWhatACrashLeftOfALine) {
  std::ofstream(file_) << "one\ntw";
  JournalFile journal(file_, 4);
  EXPECT_EQ(text(), "one\n");
  journal.append("2\n");
  EXPECT_EQ(text(), "one\n2\n");
}

TEST_F(JournalFileTest, IsAsBeforeWhenTheDiskIsFull) {
  SmallDisk disk;
  JournalFile journal(file_, 0, disk);
  journal.append("one\n");
  disk.room = 2;
  EXPECT_THAT([&] { journal.append("two\n"); },
              ThrowsMessage<FileError>(AllOf(HasSubstr("a.jsonl: cannot be written: the disk is full"),
                                             HasSubstr("what was written before is safe"))));
  EXPECT_EQ(text(), "one\n");
  EXPECT_EQ(journal.size(), 4U);
  disk.room = 100;
  journal.append("2\n");
  EXPECT_EQ(text(), "one\n2\n");
}

TEST_F(JournalFileTest, HalfALineThatCouldNotBeCutOffIsCutOffBeforeTheNext) {
  SmallDisk disk;
  JournalFile journal(file_, 0, disk);
  journal.append("one\n");
  disk.room = 9;
  disk.cut_fails = true;
  EXPECT_THAT([&] { journal.append("a very long line\n"); },
              ThrowsMessage<FileError>(HasSubstr("cannot be written: ")))
      << "what failed first is reported";
  EXPECT_EQ(text(), "one\na very lo");
  disk.room = 100;
  EXPECT_THROW(journal.append("2\n"), FileError) << "it still cannot be";
  disk.cut_fails = false;
  journal.append("2\n");
  EXPECT_EQ(text(), "one\n2\n");
}

TEST_F(JournalFileTest, DropsWhatWasAppendedLast) {
  JournalFile journal(file_, 0);
  journal.append("one\n");
  journal.append("two\n");
  journal.cut_to(4);
  journal.append("2\n");
  EXPECT_EQ(text(), "one\n2\n");
}

TEST_F(JournalFileTest, WritesOnAfterAShortWrite) {
  SmallDisk disk;
  disk.at_once = 2;
  JournalFile journal(file_, 0, disk);
  journal.append("a long line\n");
  EXPECT_EQ(text(), "a long line\n");
}

TEST_F(JournalFileTest, FlushesWhenAskedAndSaysWhenItCannot) {
  SmallDisk disk;
  JournalFile journal(file_, 0, disk);
  journal.append("one\n");
  const int before = disk.syncs;
  journal.flush();
  EXPECT_EQ(disk.syncs, before + 1);
  disk.sync_fails = true;
  EXPECT_THAT([&] { journal.flush(); }, ThrowsMessage<FileError>(HasSubstr("cannot be flushed")));
}

TEST_F(JournalFileTest, OpensNothingButPlainFiles) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT([&] { JournalFile(file_, 0); }, ThrowsMessage<FileError>(HasSubstr("not a plain file")));
}

}  // namespace
}  // namespace eigenpose
