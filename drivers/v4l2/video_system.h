#pragma once

/// The thin seam between our camera driver and the kernel: which video nodes there are, and the system calls
/// on one. The real one is `LinuxVideoSystem`; tests put an imitation in its place.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/v4l2/wake_up.h"

namespace eigenpose {

/// One /dev/video… as the system describes it.
struct VideoNode {
  std::string path;          ///< "/dev/video0"; changes with the order of plugging in
  std::string name;          ///< what the device calls itself
  std::string driver;        ///< "uvcvideo", "vivid", …
  std::string bus_info;      ///< VIDIOC_QUERYCAP's, e.g. "usb-0000:00:14.0-2"; stays with the socket
  std::string port;          ///< the device's name in sysfs, e.g. "1-2" or "vivid.0"; stays with the socket
  std::string serial;        ///< of the USB device; empty if it has none
  bool can_capture = false;  ///< single-planar capture with streaming: what this driver needs
  int open_error = 0;        ///< errno when the node cannot be opened (then driver and bus_info are empty)
};

/// How a wait ended.
enum class Readiness {
  ready,    ///< a buffer can be taken, or taking one will say what is wrong
  timeout,  ///< the deadline passed
  woken,    ///< WakeUp::wake
};

/// One open video node. Closed when destroyed. Lives on one thread.
class VideoDevice {
 public:
  virtual ~VideoDevice() = default;
  VideoDevice(const VideoDevice&) = delete;
  VideoDevice& operator=(const VideoDevice&) = delete;

  /// ioctl(2), repeated on EINTR. @return 0 or errno.
  virtual int control(unsigned long request, void* argument) = 0;
  /// mmap(2) of a buffer, shared, read and write. @return nullptr on failure, with errno set.
  virtual std::uint8_t* map(std::size_t length, std::int64_t offset) = 0;
  virtual void unmap(std::uint8_t* address, std::size_t length) = 0;
  /// poll(2) until a buffer is filled.
  virtual Readiness wait(TimePoint deadline, const WakeUp& wake_up) = 0;

 protected:
  VideoDevice() = default;
};

/// Where video nodes are found. Thread-safe.
class VideoSystem {
 public:
  virtual ~VideoSystem() = default;
  /// All nodes there are now, by number.
  virtual std::vector<VideoNode> nodes() = 0;
  /// @return the device, or nullptr with `error` = errno.
  virtual std::unique_ptr<VideoDevice> open(const std::string& path, int& error) = 0;
  /// Waits until nodes may have come or gone, for `deadline` at most.
  virtual void wait_for_change(TimePoint deadline, const WakeUp& wake_up) = 0;

 protected:
  VideoSystem() = default;
  VideoSystem(const VideoSystem&) = default;
  VideoSystem& operator=(const VideoSystem&) = default;
};

/// This machine's kernel, through /dev and /sys (other roots for tests). Needs no udev.
class LinuxVideoSystem final : public VideoSystem {
 public:
  explicit LinuxVideoSystem(std::string dev = "/dev", std::string sys = "/sys");
  std::vector<VideoNode> nodes() override;
  std::unique_ptr<VideoDevice> open(const std::string& path, int& error) override;
  void wait_for_change(TimePoint deadline, const WakeUp& wake_up) override;

 private:
  std::string dev_;
  std::string sys_;
};

/// A fixed-size character field of a V4L2 structure as text.
template <std::size_t length>
std::string text_of(const std::uint8_t (&field)[length]) {
  std::size_t end = 0;
  while (end < length && field[end] != 0) ++end;
  return std::string(field, field + end);
}

}  // namespace eigenpose
