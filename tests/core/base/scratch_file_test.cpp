#include "core/base/scratch_file.h"

#include <vector>

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

std::size_t files_in(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++count;
  return count;
}

TEST(ScratchFile, GivesBackWhatWasWrittenAnywhere) {
  ScratchFile file({}, 100);
  const std::vector<std::uint8_t> bytes{1, 2, 3, 4};
  file.write(40, bytes);
  file.write(0, bytes);
  std::vector<std::uint8_t> read(2);
  file.read(41, read);
  EXPECT_EQ(read, (std::vector<std::uint8_t>{2, 3}));
}

TEST(ScratchFile, LeavesNothingInItsFolderEvenWhileItIsOpen) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / "eigenpose_scratch_test";
  std::filesystem::create_directory(folder);
  {
    ScratchFile file(folder, 100);
    file.write(0, std::vector<std::uint8_t>{1});
    EXPECT_EQ(files_in(folder), 0U);
  }
  std::filesystem::remove(folder);
}

TEST(ScratchFile, SaysWhenTheFolderTakesNoFileOrHasNoRoom) {
  EXPECT_THROW(ScratchFile("/nonexistent", 1), FileError);
  EXPECT_THROW(ScratchFile({}, std::uintmax_t{1} << 62), FileError);
}

TEST(ScratchFile, RefusesToReadWhatWasNeverWritten) {
  const ScratchFile file({}, 100);
  std::vector<std::uint8_t> read(2);
  EXPECT_THROW(file.read(0, read), FileError);
}

}  // namespace
}  // namespace eigenpose
