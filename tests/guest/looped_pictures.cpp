#include "tests/guest/looped_pictures.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "drivers/v4l2/camera_controls.h"
#include "drivers/v4l2/video_system.h"

namespace eigenpose::test {
namespace {

constexpr int width = 640;
constexpr int height = 480;

std::string node_called(const std::string& ending) {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/video4linux")) {
    std::string name;
    std::getline(std::ifstream(entry.path() / "name") >> std::ws, name);
    if (name.ends_with(ending)) return "/dev/" + entry.path().filename().string();
  }
  throw std::runtime_error("no video node ends with " + ending);
}

std::unique_ptr<VideoDevice> open_node(const std::string& path) {
  int error = 0;
  return LinuxVideoSystem().open(path, error);
}

void must(VideoDevice& device, unsigned long request, void* argument, const char* what) {
  if (const int error = device.control(request, argument); error != 0) {
    throw std::runtime_error(std::string(what) + ": " + std::strerror(error));
  }
}

/// The first timings of vivid are 640x480 at 59.94 Hz.
void set_timings(VideoDevice& device) {
  v4l2_enum_dv_timings first{};
  must(device, VIDIOC_ENUM_DV_TIMINGS, &first, "asking for timings");
  v4l2_dv_timings timings = first.timings;
  must(device, VIDIOC_S_DV_TIMINGS, &timings, "setting timings");
}

void set_control(VideoDevice& device, const std::string& name, std::int32_t value) {
  const CameraControls controls(device);
  const ControlInfo* control = controls.find(name);
  if (control == nullptr) throw std::runtime_error("no control " + name);
  v4l2_control setting{control->id, value};
  must(device, VIDIOC_S_CTRL, &setting, name.c_str());
}

/// vivid's output, its buffers mapped.
class Output {
 public:
  explicit Output(const std::string& node)
      : descriptor_(open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)),
        open_(descriptor_ >= 0 && set_up()) {}
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  ~Output() {
    for (const auto& [memory, length] : mapped_) munmap(memory, length);
    if (descriptor_ >= 0) close(descriptor_);
  }
  [[nodiscard]] bool is_open() const { return open_; }
  [[nodiscard]] std::uint32_t buffers() const { return static_cast<std::uint32_t>(mapped_.size()); }

  /// Fills a buffer with `luma`, no colour, and queues it. @return false when the device is lost.
  bool show(std::uint32_t index, const cv::Mat& luma) {
    std::uint8_t* bytes = mapped_[index].first;
    for (int i = 0; i < width * height; ++i) {
      bytes[2 * i] = luma.data[i];
      bytes[2 * i + 1] = 128;
    }
    v4l2_buffer buffer = described(index);
    buffer.bytesused = picture_bytes_;
    buffer.field = V4L2_FIELD_NONE;
    return call(VIDIOC_QBUF, &buffer);
  }
  bool start() {
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    return call(VIDIOC_STREAMON, &type);
  }
  /// Waits a while for a buffer that was shown. @return its index; nothing, and errno, when there is none.
  std::optional<std::uint32_t> wait() {
    pollfd waits{descriptor_, POLLOUT, 0};
    errno = EAGAIN;
    if (poll(&waits, 1, 200) == 0) return std::nullopt;
    v4l2_buffer buffer = described(0);
    if (!call(VIDIOC_DQBUF, &buffer)) return std::nullopt;
    return buffer.index;
  }

 private:
  bool call(unsigned long request, void* argument) const {
    return ioctl(descriptor_, request, argument) == 0;
  }
  static v4l2_buffer described(std::uint32_t index) {
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    buffer.memory = V4L2_MEMORY_MMAP;
    return buffer;
  }
  bool set_up() {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    format.fmt.pix.width = width;
    format.fmt.pix.height = height;
    format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    v4l2_requestbuffers request{};
    request.count = 3;
    request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    request.memory = V4L2_MEMORY_MMAP;
    if (!call(VIDIOC_S_FMT, &format) || !call(VIDIOC_REQBUFS, &request)) return false;
    picture_bytes_ = format.fmt.pix.sizeimage;
    for (std::uint32_t index = 0; index < request.count; ++index) {
      v4l2_buffer buffer = described(index);
      if (!call(VIDIOC_QUERYBUF, &buffer)) return false;
      void* memory =
          mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, buffer.m.offset);
      if (memory == MAP_FAILED) return false;
      mapped_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
    }
    return true;
  }

  int descriptor_;
  std::vector<std::pair<std::uint8_t*, std::size_t>> mapped_;
  std::uint32_t picture_bytes_ = 0;
  bool open_;  ///< last: it is set up by then
};

}  // namespace

LoopedPictures::LoopedPictures(std::function<void(cv::Mat&)> draw)
    : draw_(std::move(draw)), capture_(node_called("vid-cap")), output_(node_called("vid-out")) {
  const auto capture = open_node(capture_), output = open_node(output_);
  if (capture == nullptr || output == nullptr) throw std::runtime_error("vivid's nodes cannot be opened");
  int hdmi_output = 1, hdmi_input = 3;
  must(*output, VIDIOC_S_OUTPUT, &hdmi_output, "choosing the output");
  set_timings(*output);
  must(*capture, VIDIOC_S_INPUT, &hdmi_input, "choosing the input");
  set_timings(*capture);
  set_control(*capture, "loop_video", 1);
  thread_ = std::jthread([this](const std::stop_token& stop) { feed(stop); });
}

void LoopedPictures::disconnect() {
  set_control(*open_node(capture_), "disconnect", 1);
}

void LoopedPictures::feed(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    // A disconnected vivid comes back once nobody has it open any more; so let go, and try again.
    if (!feed_until_lost(stop)) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

bool LoopedPictures::feed_until_lost(const std::stop_token& stop) {
  Output output(output_);
  const auto show = [&](std::uint32_t index) {
    cv::Mat luma(height, width, CV_8UC1, cv::Scalar(16));
    draw_(luma);
    return output.show(index, luma);
  };
  bool good = output.is_open();
  for (std::uint32_t index = 0; good && index < output.buffers(); ++index) good = show(index);
  good = good && output.start();
  while (good && !stop.stop_requested()) {
    const std::optional<std::uint32_t> shown = output.wait();
    if (!shown) {
      good = errno == EAGAIN;
      continue;
    }
    good = show(*shown);
    if (good) ++shown_;
  }
  return good;
}

}  // namespace eigenpose::test
