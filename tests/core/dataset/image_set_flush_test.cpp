// What an image set has flushed to the disk, and when: the system's calls are recorded on their way.
#include <filesystem>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/dataset/image_set.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose::test {
namespace {

/// The calls of this program since they were last taken, as "fsync views.jsonl".
class Calls {
 public:
  void note(const char* call, const std::filesystem::path& file) {
    const std::lock_guard lock(mutex_);
    const std::string name = file.filename().string();
    calls_.push_back(std::string(call) + " " + (name.starts_with(".eigenpose-part-") ? "part" : name));
  }
  void note(const char* call, int descriptor) {
    std::error_code error;
    note(call, std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(descriptor), error));
  }
  std::vector<std::string> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(calls_, {});
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> calls_;  ///< guarded by mutex_
};

Calls& calls() {
  static Calls recorded;
  return recorded;
}

}  // namespace
}  // namespace eigenpose::test

// These stand before the C library's.
extern "C" int fsync(int descriptor) {
  eigenpose::test::calls().note("fsync", descriptor);
  return static_cast<int>(::syscall(SYS_fsync, descriptor));
}
extern "C" int syncfs(int descriptor) noexcept {
  eigenpose::test::calls().note("syncfs", descriptor);
  return static_cast<int>(::syscall(SYS_syncfs, descriptor));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  eigenpose::test::calls().note("rename", std::filesystem::path(to));
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

namespace eigenpose::test {
namespace {

using ::testing::ElementsAre;

const cv::Mat picture(6, 8, CV_8UC1, cv::Scalar(7));

TEST(ImageSetFlush, EveryViewOfAnAcquisitionIsOnTheDiskBeforeItCounts) {
  const TemporaryFolder folder;
  ImageSetWriter writer(folder.path(), "mug", turntable_workspace(), nlohmann::json::object());
  (void)calls().take();
  writer.add(picture, {0.0});
  EXPECT_THAT(calls().take(),
              ElementsAre("fsync part", "rename 000000.png", "fsync mug", "fsync views.jsonl"));
  writer.finish();
  EXPECT_THAT(calls().take(), ElementsAre("fsync part", "rename set.json", "fsync mug"));
}

TEST(ImageSetFlush, AnImportIsOnTheDiskBeforeItIsMarkedComplete) {
  const TemporaryFolder folder;
  ImageSetWriter writer(folder.path(), "mug", turntable_workspace(), nlohmann::json::object(),
                        {.sync_every_view = false});
  (void)calls().take();
  writer.add(picture, {0.0});
  EXPECT_THAT(calls().take(), ElementsAre("rename 000000.png")) << "nothing waits for the disk";
  writer.finish();
  EXPECT_THAT(calls().take(), ElementsAre("syncfs mug", "fsync part", "rename set.json", "fsync mug"));
}

}  // namespace
}  // namespace eigenpose::test
