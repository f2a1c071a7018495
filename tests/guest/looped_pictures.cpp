#include "tests/guest/looped_pictures.h"

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>

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
  const int descriptor = open(output_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) return false;
  const auto call = [descriptor](unsigned long request, void* argument) {
    return ioctl(descriptor, request, argument) == 0;
  };
  constexpr std::uint32_t type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  v4l2_format format{};
  format.type = type;
  format.fmt.pix.width = width;
  format.fmt.pix.height = height;
  format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  v4l2_requestbuffers request{};
  request.count = 3;
  request.type = type;
  request.memory = V4L2_MEMORY_MMAP;
  bool good = call(VIDIOC_S_FMT, &format) && call(VIDIOC_REQBUFS, &request) && request.count <= 8;
  std::array<std::uint8_t*, 8> memory{};
  std::size_t length = 0;
  cv::Mat luma(height, width, CV_8UC1);
  const auto show = [&](std::uint32_t index) {
    luma.setTo(16);
    draw_(luma);
    for (int i = 0; i < width * height; ++i) {
      memory[index][2 * i] = luma.data[i];
      memory[index][2 * i + 1] = 128;
    }
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = type;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.bytesused = format.fmt.pix.sizeimage;
    buffer.field = V4L2_FIELD_NONE;
    return call(VIDIOC_QBUF, &buffer);
  };
  for (std::uint32_t index = 0; good && index < request.count; ++index) {
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = type;
    buffer.memory = V4L2_MEMORY_MMAP;
    good = call(VIDIOC_QUERYBUF, &buffer);
    if (!good) break;
    length = buffer.length;
    void* mapped = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, buffer.m.offset);
    good = mapped != MAP_FAILED;
    if (good) memory[index] = static_cast<std::uint8_t*>(mapped);
    good = good && show(index);
  }
  int on = static_cast<int>(type);
  good = good && call(VIDIOC_STREAMON, &on);
  while (good && !stop.stop_requested()) {
    pollfd waits{descriptor, POLLOUT, 0};
    if (poll(&waits, 1, 200) == 0) continue;
    v4l2_buffer buffer{};
    buffer.type = type;
    buffer.memory = V4L2_MEMORY_MMAP;
    good = call(VIDIOC_DQBUF, &buffer) ? show(buffer.index) : errno == EAGAIN;
    if (good) ++shown_;
  }
  for (std::uint8_t* mapped : memory) {
    if (mapped != nullptr) munmap(mapped, length);
  }
  close(descriptor);
  return good;
}

}  // namespace eigenpose::test
