#include "daemon/rig/frame_hub.h"

#include <chrono>

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// A camera that gives nothing for so long has trouble; long exposures are shorter.
constexpr std::chrono::seconds frame_timeout{3};
constexpr std::chrono::seconds retry_pause{1};

std::string words(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Counts one up while it lives; the count's lock is held at both ends.
class Waiting {
 public:
  explicit Waiting(int& count) : count_(count) { ++count_; }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;
  ~Waiting() { --count_; }

 private:
  int& count_;
};

}  // namespace

FrameHub::FrameHub(OpenCamera open, const Clock& clock) : open_(std::move(open)), clock_(clock) {
  status_.configured = static_cast<bool>(open_);
  if (open_)
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  else
    report_trouble(std::make_exception_ptr(
        DeviceError("camera", "take a picture", "there is none: add [camera] to the configuration")));
}

FrameHub::~FrameHub() = default;

FrameHub::OnDemand::OnDemand(FrameHub& hub) : hub_(hub) {
  const std::lock_guard lock(hub_.mutex_);
  ++hub_.on_demand_;
}

FrameHub::OnDemand::~OnDemand() {
  {
    const std::lock_guard lock(hub_.mutex_);
    --hub_.on_demand_;
  }
  hub_.changed_.notify_all();
}

std::optional<Frame> FrameHub::latest() const {
  const std::lock_guard lock(mutex_);
  return frame_;
}

Frame FrameHub::exposed_after(TimePoint since, TimePoint deadline, std::stop_token stop) const {
  std::unique_lock lock(mutex_);
  const Waiting waiting(waiting_);
  changed_.notify_all();
  std::uint64_t seen_frames = 0;
  std::uint64_t seen_troubles = 0;
  for (;;) {
    if (stop.stop_requested()) throw Interrupted();
    if (frame_ && !trouble_ && frame_->exposure_start >= since) return *frame_;
    if (!open_ || (trouble_ && clock_.now() >= deadline)) std::rethrow_exception(trouble_);
    if (clock_.now() >= deadline)
      throw DeviceTimeout(status_.info ? status_.info->name : "camera", "take a picture",
                          "no frame was exposed after the axes came to rest");
    seen_frames = frames_;
    seen_troubles = troubles_;
    // The camera's thread wakes us with every frame and every failure, so no deadline is needed here.
    changed_.wait(lock, stop, [&] { return frames_ != seen_frames || troubles_ != seen_troubles; });
  }
}

std::optional<Frame> FrameHub::next(std::uint64_t& cursor, std::stop_token stop) const {
  std::unique_lock lock(mutex_);
  const std::uint64_t troubles = troubles_;
  const bool woken = changed_.wait(lock, stop, [&] { return frames_ > cursor || troubles_ != troubles; });
  if (!woken || frames_ <= cursor) return std::nullopt;
  cursor = frames_;
  return frame_;
}

CameraStatus FrameHub::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void FrameHub::run(const std::stop_token& stop) {
  std::unique_ptr<Camera> camera;
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return on_demand_ == 0 || waiting_ > 0; })) return;
    }
    try {
      if (!camera) {
        camera = open_();
        const std::lock_guard lock(mutex_);
        status_.info = camera->info();
      }
      Frame frame = camera->next_frame(clock_.now() + frame_timeout, stop);
      {
        const std::lock_guard lock(mutex_);
        status_.statistics = camera->statistics();
      }
      publish(std::move(frame));
    } catch (const Interrupted&) {
      return;
    } catch (const std::exception&) {
      if (camera) {
        const std::lock_guard lock(mutex_);
        status_.statistics = camera->statistics();  // it may fail because every frame is damaged
      }
      report_trouble(std::current_exception());
      clock_.sleep_for(retry_pause, stop);
    }
  }
}

void FrameHub::publish(Frame frame) {
  bool recovered = false;
  {
    const std::lock_guard lock(mutex_);
    recovered = static_cast<bool>(trouble_);
    trouble_ = nullptr;
    status_.error.reset();
    frame_ = std::move(frame);
    ++frames_;
  }
  changed_.notify_all();
  if (recovered) spdlog::info("event=camera_recovered");
}

void FrameHub::report_trouble(const std::exception_ptr& failure) {
  const std::string text = words(failure);
  bool fresh = false;
  {
    const std::lock_guard lock(mutex_);
    fresh = status_.error != text;
    trouble_ = failure;
    status_.error = text;
    ++troubles_;
  }
  changed_.notify_all();
  if (fresh && open_) spdlog::error("event=camera_failed error=\"{}\"", text);
}

}  // namespace eigenpose
