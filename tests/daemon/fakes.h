#pragma once

/// Devices of memory only: axes and a camera that agree on where the axis is, lamps, and a camera that
/// follows a script.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "daemon/rig/rig.h"
#include "drivers/axis.h"
#include "drivers/camera.h"

namespace eigenpose {

/// Waits until `condition` holds; ctest's limit ends a wait for something that never comes.
template <typename Condition>
void eventually(Condition condition) {
  while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

/// What a test knows of a fake axis, and orders of it.
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
  double tolerance = 0.5;            ///< of arrival, read when the axis is opened
  std::optional<std::string> alarm;  ///< from now on
  int fails_from_stop = -1;          ///< from this stop on the axis cannot be told to stop
  /// Called with the lock held and the target before a move; what it throws the move throws.
  std::function<void(double)> before_move;
  /// Called with the lock held when a frame's exposure is over.
  std::function<void(FakeAxisRecord&)> on_frame;
};

/// Gives an order to a fake axis that other threads use.
template <typename Field, typename Value>
void set(FakeAxisRecord& record, Field FakeAxisRecord::*field, Value value) {
  const std::lock_guard lock(record.mutex);
  record.*field = std::move(value);
}

class FakeAxis final : public Axis {
 public:
  FakeAxis(Dof dof, FakeAxisRecord& record, const Clock& clock) : record_(record), clock_(clock) {
    info_.dof = std::move(dof);
    info_.model = "fake";
    info_.arrival_tolerance = record.tolerance;
  }
  [[nodiscard]] const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint) override {
    const std::lock_guard lock(record_.mutex);
    return {record_.position, record_.moving, record_.homed, record_.alarm};
  }
  void home(TimePoint, std::stop_token) override {
    const std::lock_guard lock(record_.mutex);
    ++record_.homings;
    record_.homed = true;
  }
  double move_to(double position, TimePoint, std::stop_token stop) override {
    check_target(info_.dof.name, info_.dof, position);
    std::unique_lock lock(record_.mutex);
    if (record_.before_move) record_.before_move(position);
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
    if (record_.fails_from_stop >= 0 && record_.stops > record_.fails_from_stop)
      throw DeviceLost(info_.dof.name, "stop", "connection closed");
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
    const std::lock_guard lock(axis_.mutex);
    if (axis_.on_frame) axis_.on_frame(axis_);
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

/// What a test knows of a fake lamp, and orders of it.
struct FakeLampRecord {
  std::atomic<bool> opens{true};    ///< it can be opened
  std::atomic<bool> answers{true};  ///< it takes levels
  std::atomic<int> levels_set{0};
  std::atomic<double> level{0.0};
  std::atomic<std::uint64_t> interruptions{0};
};

class FakeLamp final : public Lamp {
 public:
  FakeLamp(const std::string& name, FakeLampRecord& record) : record_(record), info_{name, "fake"} {
    if (!record_.opens) throw DeviceLost(name, "open", "not plugged in");
  }
  [[nodiscard]] const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint) override {
    if (!record_.answers) throw DeviceTimeout(info_.name, "set level", "no answer");
    record_.level = level;
    ++record_.levels_set;
  }
  [[nodiscard]] double level() const override { return record_.level; }
  [[nodiscard]] std::uint64_t interruptions() const override { return record_.interruptions; }

 private:
  FakeLampRecord& record_;
  LampInfo info_;
};

inline RigLamp fake_lamp(const std::string& name, double level, FakeLampRecord& record) {
  return {{name, level}, [name, &record] { return std::make_unique<FakeLamp>(name, record); }};
}

/// Frames and failures in the order in which a test gives them. Thread-safe.
class CameraScript {
 public:
  void frame(const cv::Mat& image, TimePoint exposure) {
    Frame frame;
    frame.image = image;
    frame.exposure_start = exposure;
    frame.sequence = ++sequence_;
    push([frame] { return frame; });
  }
  void failure(const std::string& cause) {
    push([cause]() -> Frame { throw DeviceLost("camera", "take a picture", cause); });
  }
  /// How many frames and failures were handed out so far.
  [[nodiscard]] int taken() const { return taken_; }
  /// Waits until everything given has been handed out and the camera was asked for more.
  void wait_until_used_up() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return steps_.empty() && asking_; });
  }

 private:
  friend class ScriptedCamera;
  using Step = std::function<Frame()>;
  void push(Step step) {
    const std::lock_guard lock(mutex_);
    steps_.push_back(std::move(step));
    changed_.notify_all();
  }
  Frame next(const std::stop_token& stop) {
    Step step;
    {
      std::unique_lock lock(mutex_);
      asking_ = true;
      changed_.notify_all();
      if (!changed_.wait(lock, stop, [this] { return !steps_.empty(); })) throw Interrupted();
      asking_ = false;
      step = std::move(steps_.front());
      steps_.pop_front();
      ++taken_;
    }
    return step();
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Step> steps_;  ///< guarded by mutex_
  bool asking_ = false;     ///< guarded by mutex_
  std::atomic<int> taken_{0};
  std::uint64_t sequence_ = 0;
};

class ScriptedCamera final : public Camera {
 public:
  explicit ScriptedCamera(CameraScript& script) : script_(script) { info_.name = "scripted"; }
  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint, std::stop_token stop) override { return script_.next(stop); }
  [[nodiscard]] CameraStatistics statistics() const override { return {}; }

 private:
  CameraScript& script_;
  CameraInfo info_;
};

}  // namespace eigenpose
