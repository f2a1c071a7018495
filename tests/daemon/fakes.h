#pragma once

/// A rig of memory only: an axis and a camera that agree on where the axis is.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "drivers/axis.h"
#include "drivers/camera.h"

namespace eigenpose {

/// What a test knows of a fake axis, and tells it.
struct FakeAxisRecord {
  std::mutex mutex;
  std::condition_variable_any changed;
  std::vector<double> moves;  ///< targets, in order
  double position = 0.0;
  TimePoint arrived{};  ///< at the last target
  bool homed = true;
  int homings = 0;
  int stops = 0;
  int lost_from_move = -1;  ///< from this move on the axis is lost
  bool blocks = false;      ///< a move waits until it is stopped
  bool moving = false;
};

class FakeAxis final : public Axis {
 public:
  FakeAxis(Dof dof, FakeAxisRecord& record, const Clock& clock) : record_(record), clock_(clock) {
    info_.dof = std::move(dof);
    info_.model = "fake";
  }
  [[nodiscard]] const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint) override {
    const std::lock_guard lock(record_.mutex);
    return {record_.position, record_.moving, record_.homed, std::nullopt};
  }
  void home(TimePoint, std::stop_token) override {
    const std::lock_guard lock(record_.mutex);
    ++record_.homings;
    record_.homed = true;
  }
  double move_to(double position, TimePoint, std::stop_token stop) override {
    std::unique_lock lock(record_.mutex);
    record_.moves.push_back(position);
    if (record_.lost_from_move >= 0 && static_cast<int>(record_.moves.size()) > record_.lost_from_move)
      throw DeviceLost(info_.dof.name, "move", "connection closed");
    record_.moving = true;
    record_.changed.notify_all();
    if (record_.blocks) {
      const int stops = record_.stops;
      record_.changed.wait(lock, stop, [&] { return record_.stops > stops; });
      record_.moving = false;
      throw Interrupted();
    }
    record_.position = position;
    record_.arrived = clock_.now();
    record_.moving = false;
    return position;
  }
  void stop_motion() override {
    const std::lock_guard lock(record_.mutex);
    ++record_.stops;
    record_.changed.notify_all();
  }

 private:
  AxisInfo info_;
  FakeAxisRecord& record_;
  const Clock& clock_;
};

/// Each frame's grey level is the axis's position divided by ten; 255 while the axis has not come to rest.
/// Frames are handed out a while after their exposure began, as real ones are.
class FakeCamera final : public Camera {
 public:
  static constexpr std::chrono::milliseconds latency{3};

  FakeCamera(FakeAxisRecord& axis, Duration settle, const Clock& clock)
      : axis_(axis), settle_(settle), clock_(clock) {
    info_.name = "fake";
    info_.width = 64;
    info_.height = 48;
  }
  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint, std::stop_token stop) override {
    Frame frame;
    frame.exposure_start = clock_.now();
    frame.sequence = ++sequence_;
    {
      const std::lock_guard lock(axis_.mutex);
      const bool rests = !axis_.moving && frame.exposure_start >= axis_.arrived + settle_;
      frame.image = cv::Mat(48, 64, CV_8UC1, cv::Scalar(rests ? axis_.position / 10.0 : 255.0));
    }
    if (!clock_.sleep_for(latency, stop)) throw Interrupted();
    return frame;
  }
  [[nodiscard]] CameraStatistics statistics() const override { return {}; }

 private:
  CameraInfo info_;
  FakeAxisRecord& axis_;
  Duration settle_;
  const Clock& clock_;
  std::uint64_t sequence_ = 0;
};

}  // namespace eigenpose
