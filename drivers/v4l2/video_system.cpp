#include "drivers/v4l2/video_system.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

int milliseconds_until(TimePoint deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
  return static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 1'000'000'000));
}

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

class LinuxVideoDevice final : public VideoDevice {
 public:
  explicit LinuxVideoDevice(int descriptor) : descriptor_(descriptor) {}
  ~LinuxVideoDevice() override { close(descriptor_); }

  int control(unsigned long request, void* argument) override {
    while (ioctl(descriptor_, request, argument) < 0) {
      if (errno != EINTR) return errno;
    }
    return 0;
  }

  std::uint8_t* map(std::size_t length, std::int64_t offset) override {
    void* address = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, offset);
    return address == MAP_FAILED ? nullptr : static_cast<std::uint8_t*>(address);
  }

  void unmap(std::uint8_t* address, std::size_t length) override { munmap(address, length); }

  Readiness wait(TimePoint deadline, const WakeUp& wake_up) override {
    for (;;) {
      std::array<pollfd, 2> waits{{{descriptor_, POLLIN, 0}, {wake_up.descriptor(), POLLIN, 0}}};
      const int count = poll(waits.data(), waits.size(), milliseconds_until(deadline));
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return Readiness::timeout;
      if (waits[1].revents != 0) return Readiness::woken;
      return Readiness::ready;  // POLLERR and POLLHUP too: taking a buffer says which
    }
  }

 private:
  int descriptor_;
};

/// Name and serial of the device behind a sysfs node: the first one upwards that is a USB device, else the
/// parent itself.
void describe_parent(const fs::path& device, VideoNode& node) {
  std::error_code failed;
  const fs::path parent = fs::canonical(device, failed);
  if (failed) return;
  node.port = parent.filename();
  for (fs::path up = parent; up.has_relative_path() && up.filename() != "devices"; up = up.parent_path()) {
    if (!fs::exists(up / "idVendor", failed)) continue;
    node.port = up.filename();
    node.serial = first_line(up / "serial");
    return;
  }
}

}  // namespace

LinuxVideoSystem::LinuxVideoSystem(std::string dev, std::string sys)
    : dev_(std::move(dev)), sys_(std::move(sys)) {}

std::vector<VideoNode> LinuxVideoSystem::nodes() {
  std::vector<std::pair<int, VideoNode>> found;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(sys_ + "/class/video4linux", failed)) {
    const std::string file = entry.path().filename();
    if (!file.starts_with("video")) continue;
    VideoNode node;
    node.path = dev_ + "/" + file;
    node.name = first_line(entry.path() / "name");
    describe_parent(entry.path() / "device", node);
    if (const auto device = open(node.path, node.open_error)) {
      v4l2_capability capability{};
      node.open_error = device->control(VIDIOC_QUERYCAP, &capability);
      if (node.open_error == 0) {
        node.name = text_of(capability.card);
        node.driver = text_of(capability.driver);
        node.bus_info = text_of(capability.bus_info);
        const std::uint32_t can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                      ? capability.device_caps
                                      : capability.capabilities;
        node.can_capture = (can & V4L2_CAP_VIDEO_CAPTURE) != 0 && (can & V4L2_CAP_STREAMING) != 0;
      }
    }
    found.emplace_back(std::atoi(file.c_str() + 5), std::move(node));
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<VideoNode> nodes;
  nodes.reserve(found.size());
  for (auto& [number, node] : found) nodes.push_back(std::move(node));
  return nodes;
}

std::unique_ptr<VideoDevice> LinuxVideoSystem::open(const std::string& path, int& error) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  error = descriptor < 0 ? errno : 0;
  if (descriptor < 0) return nullptr;
  return std::make_unique<LinuxVideoDevice>(descriptor);
}

void LinuxVideoSystem::wait_for_change(TimePoint deadline, const WakeUp& wake_up) {
  // Not every change shows in /dev (a driver may revive a node), so the watch is a short cut, not the only
  // way.
  constexpr std::chrono::milliseconds longest{100};
  const TimePoint until = std::min(deadline, std::chrono::steady_clock::now() + longest);
  const int watch = inotify_init1(IN_CLOEXEC | IN_NONBLOCK);
  if (watch >= 0) inotify_add_watch(watch, dev_.c_str(), IN_CREATE | IN_ATTRIB);
  std::array<pollfd, 2> waits{{{wake_up.descriptor(), POLLIN, 0}, {watch, POLLIN, 0}}};
  poll(waits.data(), waits.size(), milliseconds_until(until));
  if (watch >= 0) close(watch);
}

}  // namespace eigenpose
