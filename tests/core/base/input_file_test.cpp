#include "core/base/input_file.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class InputFileTest : public ::testing::Test {
 protected:
  static std::string refusal(const std::filesystem::path& file) {
    try {
      (void)read_file(file);
    } catch (const FileError& error) {
      return error.what();
    }
    return "read";
  }

  test::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "a.bin";
};

TEST_F(InputFileTest, ReadsTheWholeFile) {
  std::string text(300'000, 'x');
  text[7] = '\0';
  std::ofstream(file_, std::ios::binary) << text;
  const auto bytes = read_file(file_);
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), text);
  std::ofstream(file_, std::ios::trunc).flush();
  EXPECT_TRUE(read_file(file_).empty());
}

TEST_F(InputFileTest, ReadsPiecesUpToTheEnd) {
  std::ofstream(file_) << "0123456789";
  const InputFile in(file_);
  EXPECT_EQ(in.size(), 10U);
  std::array<std::uint8_t, 4> piece{};
  EXPECT_EQ(in.read_some(3, piece), 4U);
  EXPECT_EQ(std::string(piece.begin(), piece.end()), "3456");
  EXPECT_EQ(in.read_some(8, piece), 2U);
  EXPECT_EQ(in.read_some(10, piece), 0U);
}

TEST_F(InputFileTest, SaysThatAFileIsMissing) {
  EXPECT_THAT(refusal(file_), AllOf(StartsWith(file_.string()), HasSubstr("is not there")));
}

TEST_F(InputFileTest, RefusesWhatIsNoPlainFileWithoutWaiting) {
  EXPECT_THAT(refusal(folder_.path()), HasSubstr("is a folder; give a plain file"));
  EXPECT_THAT(refusal("/dev/zero"), HasSubstr("is a device; give a plain file"));
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT(refusal(file_), HasSubstr("is a pipe; give a plain file")) << "and nobody writes into it";
  const auto link = folder_.path() / "link";
  std::filesystem::create_symlink(file_, link);
  EXPECT_THAT(refusal(link), HasSubstr("is a pipe"));
  const auto socket = (folder_.path() / "s").string();
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  EXPECT_THAT(refusal(socket), HasSubstr("is a socket"));
  ::close(fd);
}

TEST_F(InputFileTest, RefusesAFileThatNoFormatOfOursIsAsLargeAs) {
  std::ofstream(file_).flush();
  std::filesystem::resize_file(file_, most_bytes_in_memory + 1);  // sparse
  EXPECT_THAT(refusal(file_), HasSubstr("has 1024 MiB; at most 1024 MiB are read"));
}

}  // namespace
}  // namespace eigenpose
