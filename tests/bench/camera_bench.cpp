// Our frame path against the least that can be done: take a buffer, copy its bytes, give it back.
//
// Both run over the imitated kernel, which always has a frame ready, so what is measured is the work of our
// own code: waiting, choosing the newest, dating, counting, converting. 640x480. The imitation also fills
// each frame; that is taken out of the time.

#include <cstring>

#include <benchmark/benchmark.h>
#include <linux/videodev2.h>

#include "drivers/v4l2/buffer_stream.h"
#include "drivers/v4l2/v4l2_camera.h"
#include "tests/drivers/fake_video_system.h"

namespace eigenpose::test {
namespace {

/// A camera whose next frame is always one interval away, on a clock that jumps there; its frames are left as
/// they are.
FakeCamera endless_camera(std::uint32_t fourcc) {
  FakeCamera camera;
  camera.modes = {{fourcc, 640, 480, {30}}};
  camera.fills_frames = false;
  return camera;
}

/// The floor: DQBUF, memcpy, QBUF.
void plain_copy(benchmark::State& state, std::uint32_t fourcc) {
  ManualClock clock{TimePoint(std::chrono::hours(1))};
  FakeVideoSystem system(endless_camera(fourcc), clock);
  int error = 0;
  const auto device = system.open("/dev/video0", error);
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = 640;
  format.fmt.pix.pixelformat = fourcc;
  device->control(VIDIOC_S_FMT, &format);
  BufferStream stream(*device, "camera", 4, clock);
  const WakeUp wake_up;
  std::vector<std::uint8_t> copy(format.fmt.pix.sizeimage);
  for (auto _ : state) {
    device->wait(clock.now() + std::chrono::seconds(1), wake_up);
    const auto buffer = stream.take();
    std::memcpy(copy.data(), buffer->bytes.data(), buffer->bytes.size());
    benchmark::DoNotOptimize(copy.data());
    stream.give_back(buffer->index);
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations()) * format.fmt.pix.sizeimage);
}

void next_frame(benchmark::State& state, std::uint32_t fourcc, bool color) {
  ManualClock clock{TimePoint(std::chrono::hours(1))};
  FakeVideoSystem system(endless_camera(fourcc), clock);
  V4l2CameraOptions options;
  options.mode.color = color;
  V4l2Camera camera(options, system, clock);
  for (auto _ : state) {
    const Frame frame = camera.next_frame(clock.now() + std::chrono::seconds(1), {});
    benchmark::DoNotOptimize(frame.image.data);
  }
}

BENCHMARK_CAPTURE(plain_copy, grey, V4L2_PIX_FMT_GREY)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(next_frame, grey, V4L2_PIX_FMT_GREY, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(plain_copy, yuyv, V4L2_PIX_FMT_YUYV)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(next_frame, yuyv_to_grey, V4L2_PIX_FMT_YUYV, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(next_frame, yuyv_to_bgr, V4L2_PIX_FMT_YUYV, true)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(plain_copy, nv12, V4L2_PIX_FMT_NV12)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(next_frame, nv12_to_grey, V4L2_PIX_FMT_NV12, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(next_frame, nv12_to_bgr, V4L2_PIX_FMT_NV12, true)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace eigenpose::test
