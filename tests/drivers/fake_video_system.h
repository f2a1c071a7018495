#pragma once

/// An imitation of the kernel's side of V4L2, so that the camera driver can be tested in milliseconds on any
/// machine: one camera with modes, controls, buffers and faults. What real drivers do is shown by the guest
/// tests.

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "drivers/v4l2/video_system.h"

namespace eigenpose::test {

struct FakeMode {
  std::uint32_t fourcc = 0;
  int width = 640;
  int height = 480;
  std::vector<int> rates{30};
};

struct FakeControl {
  std::uint32_t id = 0;
  std::string title;
  std::int64_t minimum = 0;
  std::int64_t maximum = 255;
  std::int64_t value = 0;
  std::uint32_t type = 1;  ///< V4L2_CTRL_TYPE_INTEGER
  std::uint32_t flags = 0;
};

/// Stamps of the frames, as good and bad drivers make them.
enum class FakeStamp { end_of_frame, start_of_frame, unknown, nonsense };

struct FakeCamera {
  VideoNode node{"/dev/video0", "Fake Camera", "fake", "usb-fake-1", "1-1", "SERIAL1", true, 0};
  std::vector<FakeMode> modes;
  std::vector<FakeControl> controls;
  FakeStamp stamp = FakeStamp::end_of_frame;
  std::uint32_t first_sequence = 0;
  std::uint32_t sequence_step = 1;  ///< 0: a driver that never counts
  unsigned least_buffers = 2;       ///< what REQBUFS grants at most is `most_buffers`
  unsigned most_buffers = 8;
  std::vector<std::uint8_t> jpeg;  ///< sent as every MJPG frame
  bool fills_frames = true;        ///< false: frames keep what their buffers hold, for measuring
};

/// A camera with YUYV at 640x480 and the usual controls.
FakeCamera usual_camera();

/// With a ManualClock, waiting moves the clock and nothing ever sleeps. With a SteadyClock it waits in real
/// time. All calls thread-safe.
class FakeVideoSystem final : public VideoSystem {
 public:
  FakeVideoSystem(FakeCamera camera, ManualClock& clock);
  FakeVideoSystem(FakeCamera camera, const SteadyClock& clock);
  ~FakeVideoSystem() override;

  std::vector<VideoNode> nodes() override;
  std::unique_ptr<VideoDevice> open(const std::string& path, int& error) override;
  void wait_for_change(TimePoint deadline, const WakeUp& wake_up) override;

  void unplug();
  void plug_in();
  /// No more frames, no error either.
  void stall(bool stalled);
  /// The next `frames` carry the error flag.
  void damage(int frames);
  /// The next `frames` are only half filled, without any flag.
  void truncate(int frames);
  /// The next `times` calls of this kind fail with `error`.
  void fail(unsigned long request, int error, int times = 1);
  /// The stream breaks: EIO until it is stopped.
  void break_stream();
  void set_sequence(std::uint32_t next);
  /// The next `plug_in` brings the camera under another name, or with other modes.
  void rename_node(const std::string& path);
  void replace_modes(std::vector<FakeMode> modes);
  /// Called when time reaches `when`.
  void at(TimePoint when, std::function<void()> action);

  std::int64_t control_value(std::uint32_t id) const;
  void set_control_value(std::uint32_t id, std::int64_t value);
  [[nodiscard]] int open_devices() const;
  [[nodiscard]] int mapped_buffers() const;
  [[nodiscard]] int frames_made() const;

 private:
  class Device;
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace eigenpose::test
